//! `--sandbox`: the files that a command is to read and to write -> a sandbox around the process,
//! before anything is read that a stranger may have made.
//!
//! Read is beneath the folders of the scenes, and what the command line names besides; written,
//! beneath the folders of the pictures. Folders that names of pictures begin with are made here,
//! for there is no rule for what is not there.

const std = @import("std");
const console = @import("console.zig");
const makeFolders = @import("pictures.zig").makeFolders;
const raylane = @import("raylane");
const sandbox_file = @import("../sandbox.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = raylane.diagnostic.Diagnostic;
const ExitCode = @import("exit_code.zig").ExitCode;
const Io = std.Io;
const Options = raylane.cli.Options;
const Sandbox = sandbox_file.Sandbox;
const cli = raylane.cli;
const settings = raylane.settings;

/// As many symbolic links in a row as the system itself follows.
const link_count_max = 40;

/// What the program reads of the system: memory that is left, its own and that of its groups; the
/// machine's id, by which temporary files are told from those of others.
const system_files = [_][]const u8{
    "/proc/meminfo", "/proc/self/status", "/proc/self/cgroup", "/sys/fs/cgroup", "/etc/machine-id",
};

/// Around all that these ask for. Null: go on, else the command ends, with a line that is said and
/// in the diagnostic.
pub fn aroundPictures(
    gpa: Allocator,
    io: Io,
    all: []const Options,
    diagnostic: *Diagnostic,
) ?ExitCode {
    var wanted: settings.Sandbox = .auto;
    var is_verbose = false;
    for (all) |*options| {
        is_verbose = is_verbose or options.verbose;
        if (wanted != .off and options.sandbox != .auto) wanted = options.sandbox;
    }
    var arena: std.heap.ArenaAllocator = .init(gpa);
    defer arena.deinit();
    var confinement: Confinement = .init(io, wanted);
    confinement.is_verbose = is_verbose;
    if (confinement.sandbox != null) for (all) |*options| {
        confinement.addPictures(arena.allocator(), options) catch {
            confinement.deinit();
            diagnostic.message.set("out of memory", .{});
            return console.outOfMemory(io);
        };
    };
    return confinement.enter(diagnostic);
}

/// A sandbox that is being set up. Nothing is added to what is not wanted, or not there.
pub const Confinement = struct {
    io: Io,
    wanted: settings.Sandbox,
    sandbox: ?Sandbox,
    /// Says what holds the process.
    is_verbose: bool = false,
    /// Scenes' folder that was added last.
    folder: []const u8 = "",

    pub fn init(io: Io, wanted: settings.Sandbox) Confinement {
        const sandbox: ?Sandbox = if (wanted == .off) null else .init();
        if (sandbox) |*made| for (system_files) |path| made.allowReading(path);
        return .{ .io = io, .wanted = wanted, .sandbox = sandbox };
    }

    /// Does without.
    pub fn deinit(confinement: *Confinement) void {
        if (confinement.sandbox) |*sandbox| sandbox.deinit();
        confinement.* = undefined;
    }

    /// A file that is read, wherever links lead to it.
    pub fn addFile(confinement: *const Confinement, path: []const u8) void {
        if (confinement.sandbox) |*sandbox| sandbox.allowReading(path);
    }

    /// A scene, by a name that lives on, and what it may name.
    pub fn addScene(confinement: *Confinement, path: []const u8, allow_outside: bool) void {
        const sandbox = if (confinement.sandbox) |*made| made else return;
        if (std.mem.startsWith(u8, path, settings.builtin_prefix)) return;
        if (allow_outside) return sandbox.allowReading("/");
        const is_stdin = std.mem.eql(u8, path, settings.standard_input);
        const folder = if (is_stdin) "." else std.fs.path.dirname(path) orelse ".";
        if (!std.mem.eql(u8, folder, confinement.folder)) sandbox.allowReading(folder);
        confinement.folder = folder;
        var buffer: [Io.Dir.max_path_bytes]u8 = undefined;
        _ = Io.Dir.cwd().readLink(confinement.io, path, &buffer) catch return;
        sandbox.allowReading(path);
    }

    /// A file that is made or replaced, where links lead.
    pub fn addOutput(confinement: *const Confinement, path: []const u8) void {
        const sandbox = if (confinement.sandbox) |*made| made else return;
        const io = confinement.io;
        const cwd: Io.Dir = .cwd();
        var buffers: [2][Io.Dir.max_path_bytes]u8 = undefined;
        var link_buffer: [Io.Dir.max_path_bytes]u8 = undefined;
        var name = path;
        for (0..link_count_max) |turn| {
            if (cli.isStdout(name) or raylane.output.descriptorOf(name) != null) return;
            const link = link_buffer[0 .. cwd.readLink(io, name, &link_buffer) catch break];
            const is_absolute = std.fs.path.isAbsolute(link);
            const folder = if (is_absolute) "/" else std.fs.path.dirname(name) orelse ".";
            name = std.mem.print(&buffers[turn % 2], "{s}/{s}", .{ folder, link }) catch return;
        }
        if (cwd.statFile(io, name, .{})) |status| {
            if (status.kind != .file) return sandbox.allowWriting(name);
        } else |_| {}
        sandbox.allowReplacing(std.fs.path.dirname(name) orelse ".", false);
    }

    /// Everything: jobs that are not known yet may name any file.
    pub fn addAll(confinement: *const Confinement) void {
        const sandbox = if (confinement.sandbox) |*made| made else return;
        sandbox.allowReading("/");
        sandbox.allowReplacing("/", true);
    }

    fn addPictures(
        confinement: *Confinement,
        arena: Allocator,
        options: *const Options,
    ) error{OutOfMemory}!void {
        const allow_outside = options.load.allow_outside;
        var is_batch = options.isBatch();
        var unused: Diagnostic = .{};
        var inputs = options.inputs(&unused);
        while (inputs.next()) |input| {
            var found: std.ArrayList(raylane.batch.File) = .empty;
            switch (try raylane.batch.gather(arena, confinement.io, input, &found)) {
                .file => {},
                .folder, .unreadable => {
                    is_batch = true;
                    confinement.addFile(input);
                },
            }
            for (found.items) |*file| confinement.addScene(file.path, allow_outside);
        }
        switch (options.view.environment.source) {
            .file => |path| confinement.addFile(path),
            else => {},
        }
        if (options.progress_image) |path| confinement.addOutput(path);
        if (options.toStdout()) return;
        if (!is_batch) return confinement.addOutput(try cli.outputName(arena, options));
        const format = options.write.format;
        confinement.addTemplate(try cli.templateOf(arena, &options.batch, options.output, format));
    }

    /// The folder that all names begin with, which is made, and those below it.
    fn addTemplate(confinement: *const Confinement, template: []const u8) void {
        const io = confinement.io;
        const fixed = template[0 .. std.mem.findScalar(u8, template, '{') orelse template.len];
        const slash = std.mem.findScalarLast(u8, fixed, '/');
        const folder = if (slash) |end| fixed[0..@max(1, end)] else ".";
        makeFolders(io, folder);
        if (fixed.len == template.len) return confinement.addOutput(template);
        confinement.sandbox.?.allowReplacing(folder, true);
    }

    /// Closes it around the process. Null: go on, also where a sandbox is not there that nobody
    /// insists on; else the command ends, with a line that is said and in the diagnostic.
    pub fn enter(confinement: *Confinement, diagnostic: *Diagnostic) ?ExitCode {
        if (confinement.wanted == .off) return null;
        const held: sandbox_file.Held = if (confinement.sandbox) |*sandbox|
            sandbox.enter()
        else
            .{};
        const abi = held.landlock_abi;
        const message = &diagnostic.message;
        if (confinement.wanted == .on and (abi == 0 or !held.has_seccomp)) {
            const missing = if (held.has_seccomp) "Landlock" else "seccomp";
            message.set("'--sandbox on', but this system has no {s}", .{missing});
            console.say(confinement.io, "raylane: {s}\n", .{message.text()});
            return .failed;
        }
        if (!confinement.is_verbose) return null;
        const io = confinement.io;
        if (!held.has_seccomp)
            console.say(io, "raylane: sandbox: none, for this system has no seccomp\n", .{})
        else if (abi == 0)
            console.say(io, "raylane: sandbox: seccomp; this system has no Landlock\n", .{})
        else
            console.say(io, "raylane: sandbox: Landlock (ABI {d}) and seccomp\n", .{abi});
        return null;
    }
};
