"""The one error of this package: a line for people, and an exit code as `raylane` has them."""

FAILED = 1
USAGE = 2
INVALID = 3


class FarmError(Exception):
    """Ends the job. The text is one line and stands on its own."""

    def __init__(self, text: str, code: int = FAILED) -> None:
        super().__init__(text)
        self.code = code
