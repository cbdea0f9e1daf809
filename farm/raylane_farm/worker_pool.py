"""Who takes part in a job: workers that have the same program, and all files of the scene.

Workers come and go. A new one is asked how it stands (`task_runner.greet`, by `Client.run`), is
refused by name where its program is another, and gets the files that its cache lacks: pieces are
scattered once and taken, piece by piece, by a task on each worker that needs them. Workers with
the same cache get a file once.
"""

from __future__ import annotations

import dataclasses
import secrets
import threading
from typing import Any, Callable, Dict, List, Set

from distributed import Client

from .errors import FarmError

PIECE = 16 << 20
# Tries until a worker answers, and until it has all files.
TRIES = 10
ASK_TIMEOUT_S = 60


@dataclasses.dataclass(frozen=True)
class Member:
    """A worker that may be given tasks."""

    address: str
    name: str
    slots: int


class WorkerPool:
    """The workers of a job."""

    def __init__(
        self,
        client: Client,
        task_runner: Any,
        job: Any,
        sources: Dict[str, str],
        say: Callable[[str], None],
    ) -> None:
        self._client = client
        self._task_runner = task_runner
        self._job = job
        self._sources = sources
        self._say = say
        self._members: Dict[str, Member] = {}
        self._greetings: Dict[str, Any] = {}
        self._refused: Dict[str, str] = {}
        self._failures: Dict[str, int] = {}
        self._alive: Set[str] = set()
        self._thread: "threading.Thread | None" = None
        self._error: "BaseException | None" = None

    def members(self) -> List[Member]:
        """Those that are there and ready."""
        return [m for address, m in sorted(self._members.items()) if address in self._alive]

    def refusals(self) -> List[str]:
        """Why workers that are there do not take part."""
        return [why for address, why in sorted(self._refused.items()) if address in self._alive]

    def update(self, wait: bool = False) -> None:
        """Looks who is there; new ones are made ready beside the job, or before this returns."""
        if self._error is not None:
            raise self._error
        threads: Dict[str, int] = self._client.nthreads()
        self._alive = set(threads)
        if self._thread is not None and self._thread.is_alive():
            return
        new = [a for a in threads if a not in self._members and a not in self._refused]
        new = [a for a in new if self._failures.get(a, 0) < TRIES]
        if not new:
            return
        self._thread = threading.Thread(target=self._enlist_all, args=(new, threads), daemon=True)
        self._thread.start()
        if wait:
            self._thread.join()
            if self._error is not None:
                raise self._error

    def _enlist_all(self, addresses: List[str], threads: Dict[str, int]) -> None:
        try:
            self._enlist(addresses, threads)
        except FarmError as error:
            self._error = error
        except Exception as error:  # pylint: disable=broad-except
            # Dask's own: a worker went in between, and may come back.
            self._note_failure(addresses, error)

    def _enlist(self, addresses: List[str], threads: Dict[str, int]) -> None:
        left = list(addresses)
        for _ in range(TRIES):
            greetings = self._ask(left)
            needing: Dict[str, List[Any]] = {}
            for address, greeting in greetings.items():
                if greeting.refusal is not None:
                    self._refuse(address, greeting)
                    left.remove(address)
            caches: Set[str] = set()
            for address in left:
                greeting = greetings.get(address)
                if greeting is None or not greeting.missing or greeting.cache in caches:
                    continue
                caches.add(greeting.cache)
                for digest in greeting.missing:
                    needing.setdefault(digest, []).append(address)
            if not needing:
                break
            for digest, receivers in needing.items():
                self._send(digest, receivers)
        ready = {a: greetings[a] for a in left if a in greetings and not greetings[a].missing}
        for address, greeting in ready.items():
            self._members[address] = Member(address, greeting.worker, threads[address])
            self._greetings[address] = greeting
        self._share_processors()
        self._note_failure([a for a in left if a not in ready], None)

    def _ask(self, addresses: List[str]) -> Dict[str, Any]:
        answers = self._client.run(
            self._task_runner.greet, self._job, workers=addresses, on_error="return"
        )
        good = {}
        for address, answer in answers.items():
            if isinstance(answer, BaseException):
                self._note_failure([address], answer)
                addresses.remove(address)
            else:
                good[address] = answer
        return good

    def _refuse(self, address: str, greeting: Any) -> None:
        why = f"worker '{greeting.worker}' on {greeting.host} ({address}): {greeting.refusal}"
        self._refused[address] = why
        self._say(f"raylane_farm: warning: left out: {why}")

    def _note_failure(self, addresses: List[str], error: "BaseException | None") -> None:
        for address in addresses:
            count = self._failures[address] = self._failures.get(address, 0) + 1
            if count == TRIES and address in self._alive:
                why = f"{type(error).__name__}: {error}" if error else "does not get all files"
                self._refused[address] = f"worker {address}: {why}"
                self._say(f"raylane_farm: warning: left out: {self._refused[address]}")

    def _send(self, digest: str, receivers: List[str]) -> None:
        """Gives a file to workers. What went wrong shows when they are asked again."""
        path = self._sources[digest]
        try:
            with open(path, "rb") as file:
                offset = 0
                piece = file.read(PIECE)
                while receivers:
                    following = file.read(PIECE)
                    receivers = self._send_piece(digest, offset, not following, piece, receivers)
                    if not following:
                        return
                    offset += len(piece)
                    piece = following
        except OSError as error:
            raise FarmError(f"{path}: cannot be read: {error.strerror}") from None

    def _send_piece(
        self, digest: str, offset: int, is_last: bool, piece: bytes, receivers: List[str]
    ) -> List[str]:
        # Of its own each time: what is scattered is not computed anew when a worker is lost.
        key = f"raylane-piece-{self._job.name}-{secrets.token_hex(8)}"
        held = self._client.scatter({key: piece}, workers=receivers[:1], timeout=ASK_TIMEOUT_S)
        tasks = {
            address: self._client.submit(
                self._task_runner.receive,
                self._job.name,
                digest,
                offset,
                is_last,
                held[key],
                key=f"{key}-{address}",
                workers=[address],
                retries=0,
                pure=False,
            )
            for address in receivers
        }
        good = []
        for address, task in tasks.items():
            try:
                if task.result(timeout=ASK_TIMEOUT_S):
                    good.append(address)
            except Exception:  # pylint: disable=broad-except
                task.cancel()
        return good

    def _share_processors(self) -> None:
        """Programs that run at the same time on a host share its processors."""
        members = self.members()
        slots: Dict[str, int] = {}
        for member in members:
            host = self._greetings[member.address].host
            slots[host] = slots.get(host, 0) + member.slots
        shares: Dict[int, List[str]] = {}
        for member in members:
            greeting = self._greetings[member.address]
            share = max(1, greeting.cpu_count // slots[greeting.host])
            shares.setdefault(share, []).append(member.address)
        for share, addresses in shares.items():
            self._client.run(
                self._task_runner.use_threads,
                self._job.name,
                share,
                workers=addresses,
                on_error="ignore",
            )
