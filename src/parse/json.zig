//! A JSON validator: the text is checked before anything believes it.
//!
//! In: bytes and a `Rule` that says what a document may hold where. Out: nothing, or one line with
//! the place and what is wrong. One linear scan with an explicit stack, strict about the grammar
//! (RFC 8259), UTF-8, depth, whole numbers and keys that stand twice. What the rule does not know
//! only has to be JSON. A second scan, for documents that have not passed, leaves out what can be
//! left out (json/lenience.zig).

const std = @import("std");
const diagnostic_data = @import("../diagnostic.zig");
const escapes = @import("json/escapes.zig");
const numbers = @import("json/numbers.zig");
const Graph = @import("json/graph.zig");
const Lenience = @import("json/lenience.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = diagnostic_data.Diagnostic;
const assert = std.debug.assert;

/// Deepest nesting of arrays and objects.
pub const depth_max = 256;
/// Most elements of an array that a rule describes.
pub const list_length_max = 4 << 20;
/// Longest number that a rule asks for, in characters.
pub const number_bytes_max = 127;
/// Lists whose lengths are counted.
pub const list_count_max = 16;

/// What may stand at a place of a document.
pub const Rule = union(enum) {
    any,
    boolean,
    string,
    /// A string of these; others get a warning.
    word: []const []const u8,
    /// A number that a 32-bit float can hold, if not exactly.
    number,
    /// A number; one that is not above 0 gets a warning.
    positive,
    /// A whole number from 0 to 2^53 - 1 that a `usize` can hold.
    whole,
    /// A whole number that stands for an element of a counted list.
    reference: Reference,
    /// An array of this many numbers.
    vector: u8,
    /// The same, kept in double precision.
    doubles: Doubles,
    array: Array,
    object: *const Object,
};

/// A whole number that names an element of a list.
pub const Reference = struct {
    list: u8,
    role: Role = .plain,

    /// What naming an element does to it.
    pub const Role = enum {
        plain,
        /// It gets a parent, and may have one only.
        child,
        /// It has no parent.
        root,
    };
};

/// An array of numbers of an element of a counted list, of which the first has this slot.
pub const Doubles = struct { length: u8, slot: u8 };

/// A number that single precision does not hold: of which element of its counted list, which slot.
pub const Double = struct { element: u32, slot: u8, value: f64 };

/// What is known of a document that `check` has passed.
pub const Checked = struct {
    lengths: Lengths,
    /// As many `Double`s as it has.
    double_count: usize,
};

/// An array of any length up to `list_length_max`.
pub const Array = struct {
    item: *const Rule,
    /// The counted list that it is.
    list: ?u8 = null,
    /// What stands for an element that is left out; null: what holds the list is, not the element.
    substitute: ?[]const u8 = null,
};

/// An object, at most 64 of whose keys are known.
pub const Object = struct {
    fields: []const Field = &.{},
    /// What other keys may hold.
    rest: *const Rule = &.any,
};

/// A known key of an object.
pub const Field = struct {
    name: []const u8,
    rule: Rule,
    required: bool = false,
    /// Whether it is left out where it breaks its rule, for nobody looks at it.
    is_spare: bool = false,
    /// Whether it and the others of its object that are so exclude each other.
    is_alternative: bool = false,

    /// Whether what breaks its rule is left out, and the object stays: what nobody looks at, what
    /// is null, and what should be a counted list, whose elements others miss or do not.
    fn mayGo(field: *const Field, is_null: bool) bool {
        if (field.is_spare) return true;
        const is_list = field.rule == .array and field.rule.array.list != null;
        return !field.required and (is_null or is_list);
    }
};

/// Lengths of the counted lists.
pub const Lengths = [list_count_max]u64;

/// Checks a whole document and counts its lists and doubles. References are not compared with the
/// lists' lengths.
pub fn check(
    text: []const u8,
    rule: *const Rule,
    diagnostic: *Diagnostic,
) error{InvalidInput}!Checked {
    if (!std.unicode.utf8ValidateSlice(text))
        return diagnostic.invalid("the JSON text is not UTF-8", .{});
    var scanner: Scanner = .{ .text = text, .diagnostic = diagnostic, .said = diagnostic };
    scanner.run(rule) catch |err| switch (err) {
        error.InvalidInput => |other| return other,
        error.OutOfMemory => unreachable, // It takes memory for what is left out alone.
    };
    return .{ .lengths = scanner.lengths, .double_count = scanner.double_count };
}

/// Checks a document and notes what has to be changed, until the rule holds, in `lenience`: that is
/// for its `apply`. What is left out is a warning of `said`, or an element of a counted list that
/// is broken; references are followed with a `graph`. On an error `said` has the line.
pub fn checkLeniently(
    text: []const u8,
    rule: *const Rule,
    lenience: *Lenience,
    graph: ?*Graph,
    said: *Diagnostic,
) error{ OutOfMemory, InvalidInput }!Checked {
    if (!std.unicode.utf8ValidateSlice(text))
        return said.invalid("the JSON text is not UTF-8", .{});
    var unheard: Diagnostic = .{};
    var scanner: Scanner = .{
        .text = text,
        .diagnostic = &unheard,
        .said = said,
        .lenience = lenience,
        .graph = graph,
        .references = if (graph) |known| .{ .lengths = known.lengths } else null,
    };
    scanner.run(rule) catch |err| {
        said.message = unheard.message;
        return err;
    };
    return .{ .lengths = scanner.lengths, .double_count = scanner.double_count };
}

/// Looks again at a document that `check` has passed, for references that lead nowhere and for
/// elements with two parents; `noun` is what those are called. Returns without an error when all
/// are good.
pub fn checkReferences(
    gpa: Allocator,
    text: []const u8,
    rule: *const Rule,
    lengths: Lengths,
    noun: []const u8,
    diagnostic: *Diagnostic,
) error{ OutOfMemory, InvalidInput }!void {
    var length: usize = 0;
    for (lengths) |list_length| length = @max(length, @as(usize, @intCast(list_length)));
    var children: std.DynamicBitSetUnmanaged = try .initEmpty(gpa, length);
    defer children.deinit(gpa);
    var roots: std.DynamicBitSetUnmanaged = try .initEmpty(gpa, length);
    defer roots.deinit(gpa);
    var unheard: Diagnostic = .{}; // The warnings have been given.
    var scanner: Scanner = .{
        .text = text,
        .diagnostic = &unheard,
        .said = &unheard,
        .references = .{
            .lengths = lengths,
            .family = .{ .children = &children, .roots = &roots },
        },
    };
    scanner.run(rule) catch |err| {
        diagnostic.message = unheard.message;
        return err;
    };
    roots.setIntersection(children);
    if (roots.findFirstSet()) |index|
        return diagnostic.invalid("{s} {d} is a root and a child at once", .{ noun, index });
}

/// The doubles of a document that `check` has passed, in their order; the caller frees them. With
/// `lenience` where something had to be left out of it.
pub fn readDoubles(
    gpa: Allocator,
    text: []const u8,
    rule: *const Rule,
    checked: *const Checked,
    lenience: ?*Lenience,
) error{OutOfMemory}![]Double {
    const doubles = try gpa.alloc(Double, checked.double_count);
    if (doubles.len == 0) return doubles;
    var unheard: Diagnostic = .{}; // The warnings have been given.
    var scanner: Scanner = .{
        .text = text,
        .diagnostic = &unheard,
        .said = &unheard,
        .doubles = doubles,
        .lenience = lenience,
    };
    scanner.run(rule) catch unreachable; // It has been passed.
    assert(scanner.double_count == doubles.len);
    return doubles;
}

/// What the second look compares with.
const References = struct {
    lengths: Lengths,
    family: ?struct {
        children: *std.DynamicBitSetUnmanaged,
        roots: *std.DynamicBitSetUnmanaged,
    } = null,
};

/// An array or object that is not closed yet.
const Frame = struct {
    is_object: bool,
    object: *const Object = &.{},
    item: *const Rule = &.any,
    list: ?u8 = null,
    /// Of the first of the numbers that are kept.
    slot: ?u8 = null,
    length_max: u64 = std.math.maxInt(u64),
    length_min: u64 = 0,
    /// Known keys met so far, as bits.
    seen: u64 = 0,
    /// Elements or keys met so far.
    count: u64 = 0,
    key: []const u8 = "",
    /// Of the key that was met last, if it is known.
    field: ?*const Field = null,
    /// Where the key and its value begin, or the element that was met last.
    key_start: usize = 0,
    value_start: usize = 0,
    /// Where it begins itself.
    start: usize = 0,
    substitute: ?[]const u8 = null,
    /// Of the references in it.
    role: Reference.Role = .plain,
};

const Scanner = struct {
    const Error = error{ InvalidInput, OutOfMemory };

    text: []const u8,
    /// Gets the line of an error.
    diagnostic: *Diagnostic,
    /// Gets the warnings.
    said: *Diagnostic,
    lenience: ?*Lenience = null,
    /// Where there is one, the text has been scanned before.
    graph: ?*Graph = null,
    /// Whether the error is one of the text as a whole.
    is_fatal: bool = false,
    references: ?References = null,
    offset: usize = 0,
    stack: [depth_max]Frame = undefined,
    depth: usize = 0,
    lengths: Lengths = @splat(0),
    double_count: usize = 0,
    /// Where doubles go, if they are kept.
    doubles: ?[]Double = null,

    fn run(scanner: *Scanner, rule: *const Rule) Error!void {
        scanner.skipSpace();
        try scanner.value(rule);
        while (scanner.depth > 0) scanner.step() catch |err| try scanner.recover(err);
        scanner.skipSpace();
        if (scanner.offset < scanner.text.len) return scanner.syntax("text behind the document");
    }

    /// Reads up to the end of the innermost container's next element, or closes the container.
    fn step(scanner: *Scanner) Error!void {
        const frame = &scanner.stack[scanner.depth - 1];
        scanner.skipSpace();
        const closing: u8 = if (frame.is_object) '}' else ']';
        if (scanner.peek() == closing) return scanner.close();
        if (frame.count > 0) {
            try scanner.expect(',', "a comma or the end of the list");
            scanner.skipSpace();
        }
        if (frame.count == frame.length_max) {
            if (frame.list != null) scanner.is_fatal = true;
            return scanner.wrong("has over {d} elements", .{frame.length_max});
        }
        var item = frame.item;
        if (frame.is_object) item = try scanner.readKey(frame);
        frame.value_start = scanner.offset;
        if (scanner.lenience) |lenience| if (frame.list) |list| {
            if (lenience.isBroken(list, @intCast(frame.count))) item = &.any;
        };
        frame.count += 1;
        try scanner.value(item);
    }

    fn readKey(scanner: *Scanner, frame: *Frame) Error!*const Rule {
        if (scanner.peek() != '"') return scanner.syntax("a key in quotes is expected");
        frame.key_start = scanner.offset;
        frame.field = null;
        frame.key = try scanner.readString();
        scanner.skipSpace();
        try scanner.expect(':', "a colon");
        scanner.skipSpace();
        for (frame.object.fields, 0..) |*field, index| {
            if (!std.mem.eql(u8, field.name, frame.key)) continue;
            const bit = @as(u64, 1) << @intCast(index);
            if (frame.seen & bit != 0) {
                if (field.is_spare) if (scanner.lenience) |lenience| {
                    try lenience.hideKey(frame.key_start);
                    scanner.said.forgive("{f}: stands twice, the first one counts", .{
                        Path{ .scanner = scanner },
                    });
                    return &.any;
                };
                frame.count += 1;
                return scanner.wrong("stands twice", .{});
            }
            if (field.is_alternative) for (frame.object.fields, 0..) |*other, at| {
                const is_seen = frame.seen >> @intCast(at) & 1 != 0;
                if (other.is_alternative and is_seen)
                    return scanner.wrong("stands beside '{s}'", .{other.name});
            };
            frame.seen |= bit;
            frame.field = field;
            return &field.rule;
        }
        return frame.object.rest;
    }

    fn close(scanner: *Scanner) Error!void {
        const frame = &scanner.stack[scanner.depth - 1];
        scanner.offset += 1;
        scanner.depth -= 1;
        if (frame.list) |list| scanner.lengths[list] = frame.count;
        if (frame.role != .plain) if (scanner.graph) |graph| try scanner.closeFamily(graph, frame);
        if (frame.count < frame.length_min) {
            return scanner.wrong("{d} numbers are expected", .{frame.length_min});
        }
        for (frame.object.fields, 0..) |*field, index| {
            const seen = frame.seen >> @intCast(index) & 1 != 0;
            if (field.required and !seen) return scanner.wrong("'{s}' is missing", .{field.name});
        }
    }

    fn value(scanner: *Scanner, rule: *const Rule) Error!void {
        const byte = scanner.peek() orelse return scanner.syntax("the text ends too early");
        switch (byte) {
            '{' => switch (rule.*) {
                .any => try scanner.push(.{ .is_object = true }),
                .object => |object| try scanner.push(.{
                    .is_object = true,
                    .object = object,
                }),
                else => return scanner.unexpected(rule),
            },
            '[' => switch (rule.*) {
                .any => try scanner.push(.{ .is_object = false }),
                .doubles => |doubles| try scanner.push(.{
                    .is_object = false,
                    .item = &.number,
                    .slot = doubles.slot,
                    .length_max = doubles.length,
                    .length_min = doubles.length,
                }),
                .array => |array| try scanner.push(.{
                    .is_object = false,
                    .item = array.item,
                    .list = array.list,
                    .length_max = list_length_max,
                    .substitute = array.substitute,
                    .start = scanner.offset,
                    .role = switch (array.item.*) {
                        .reference => |to| to.role,
                        else => .plain,
                    },
                }),
                .vector => |length| try scanner.push(.{
                    .is_object = false,
                    .item = &.number,
                    .length_max = length,
                    .length_min = length,
                }),
                else => return scanner.unexpected(rule),
            },
            '"' => try scanner.stringValue(rule),
            '-', '0'...'9' => try scanner.numberValue(rule),
            't' => try scanner.word("true", rule.* == .boolean, rule),
            'f' => try scanner.word("false", rule.* == .boolean, rule),
            'n' => try scanner.word("null", false, rule),
            else => return scanner.syntax("a value is expected"),
        }
    }

    fn push(scanner: *Scanner, frame: Frame) Error!void {
        if (scanner.depth == depth_max) {
            scanner.is_fatal = true;
            return scanner.diagnostic.invalid(
                "the JSON text is nested over {d} deep",
                .{depth_max},
            );
        }
        if (frame.role != .plain) if (scanner.graph) |graph| graph.members.clearRetainingCapacity();
        scanner.stack[scanner.depth] = frame;
        scanner.depth += 1;
        scanner.offset += 1;
    }

    fn word(
        scanner: *Scanner,
        comptime name: []const u8,
        allowed: bool,
        rule: *const Rule,
    ) error{InvalidInput}!void {
        if (!std.mem.startsWith(u8, scanner.text[scanner.offset..], name)) {
            return scanner.syntax("a value is expected");
        }
        if (!allowed and rule.* != .any) return scanner.unexpected(rule);
        scanner.offset += name.len;
    }

    fn stringValue(scanner: *Scanner, rule: *const Rule) Error!void {
        switch (rule.*) {
            .any, .string => _ = try scanner.readString(),
            .word => |words| {
                const content = try scanner.readString();
                for (words) |known| if (std.mem.eql(u8, known, content)) return;
                if (scanner.graph == null) scanner.said.forgive("{f}: {f} is not known, ignored", .{
                    Path{ .scanner = scanner }, diagnostic_data.quote(content),
                });
            },
            else => return scanner.unexpected(rule),
        }
    }

    fn numberValue(scanner: *Scanner, rule: *const Rule) Error!void {
        const start = scanner.offset;
        try scanner.skipNumber();
        const digits = scanner.text[start..scanner.offset];
        switch (rule.*) {
            .any => return,
            .number, .positive, .whole, .reference => {},
            else => return scanner.unexpected(rule),
        }
        if (digits.len > number_bytes_max) return scanner.wrong("a number of {d} characters", .{
            digits.len,
        });
        if (rule.* == .number or rule.* == .positive) {
            const float = numbers.parseFloat(digits) orelse
                return scanner.wrong("{s} is out of range", .{digits});
            const is_odd = rule.* == .positive and !(float > 0);
            if (is_odd and scanner.graph == null) scanner.said.forgive(
                "{f}: {s} is not above 0, ignored",
                .{ Path{ .scanner = scanner }, digits },
            );
            scanner.keepDouble(digits, float);
            return;
        }
        const whole = numbers.parseInteger(digits) orelse
            return scanner.wrong("{s} is not a whole number from 0 to 2^53 - 1", .{digits});
        if (whole > std.math.maxInt(usize)) return scanner.wrong("{d} is too large", .{whole});
        if (rule.* == .reference) {
            // To cgltf what its int does not hold is -1, which is no reference at all.
            if (whole >= list_length_max) return scanner.wrong(
                "{d} names nothing, lists have {d} elements at most",
                .{ whole, list_length_max },
            );
            try scanner.resolve(rule.reference, whole);
        }
    }

    /// Counts a number that is asked for in double precision, and keeps it the second time.
    fn keepDouble(scanner: *Scanner, digits: []const u8, single: f32) void {
        if (scanner.depth == 0) return;
        const frame = &scanner.stack[scanner.depth - 1];
        const slot = frame.slot orelse return;
        const double = numbers.parseDouble(digits) orelse return;
        if (double == single) return;
        scanner.double_count += 1;
        const doubles = scanner.doubles orelse return;
        var depth = scanner.depth;
        while (depth > 0) : (depth -= 1) {
            const above = &scanner.stack[depth - 1];
            if (above.list == null) continue;
            doubles[scanner.double_count - 1] = .{
                .element = @intCast(above.count - 1),
                .slot = slot + @as(u8, @intCast(frame.count - 1)),
                .value = double,
            };
            return;
        }
        unreachable; // A rule for doubles stands within a counted list.
    }

    fn resolve(scanner: *Scanner, reference: Reference, index: u64) Error!void {
        const references = scanner.references orelse return;
        const length = references.lengths[reference.list];
        if (index >= length) return scanner.wrong("{d} of {d}", .{ index, length });
        if (reference.role == .plain) return;
        const of: u32 = @intCast(index);
        if (scanner.graph) |graph| {
            try graph.members.append(graph.gpa, of);
            if (reference.role == .root or !graph.is_first) return;
            if (!graph.adopt(scanner.enclosing(reference.list), of))
                return scanner.wrong("{d} has two parents", .{index});
            return;
        }
        const family = references.family orelse return;
        if (reference.role == .root) return family.roots.set(of);
        if (family.children.isSet(of)) return scanner.wrong("{d} has two parents", .{index});
        family.children.set(of);
    }

    /// The element of a counted list that the scanner is in. Asserts that it is in one.
    fn enclosing(scanner: *const Scanner, list: u8) u32 {
        var depth = scanner.depth;
        while (depth > 0) : (depth -= 1) {
            const frame = &scanner.stack[depth - 1];
            if (frame.list == list) return @intCast(frame.count - 1);
        }
        unreachable;
    }

    /// Behind a list of children or roots: leaves out those that say nothing new.
    fn closeFamily(scanner: *Scanner, graph: *Graph, frame: *const Frame) Error!void {
        const lenience = scanner.lenience.?;
        if (graph.is_first != (frame.role == .child)) return;
        const odd = if (frame.role == .child) graph.tidyChildren() else try graph.tidyRoots();
        if (odd.stray) |node| return scanner.wrong("{d} is a root and a child at once", .{node});
        if (graph.members.items.len == frame.count) return;
        if (odd.twice) |node| scanner.said.forgive("{f}: {d} stands twice, counted once", .{
            Path{ .scanner = scanner }, node,
        });
        if (odd.child) |node| scanner.said.forgive(
            "{f}: {d} is a child of another node there, listed once too often",
            .{ Path{ .scanner = scanner }, node },
        );
        try lenience.replaceNumbers(frame.start, scanner.offset, graph.members.items);
    }

    /// Goes on behind what breaks a rule: a field that may go, or the whole element of a list that
    /// has a substitute for it. `err` itself where it can only be refused.
    fn recover(scanner: *Scanner, err: Error) Error!void {
        const lenience = scanner.lenience orelse return err;
        if (err != error.InvalidInput or scanner.is_fatal) return err;
        while (scanner.depth > 0) : (scanner.depth -= 1) {
            const frame = &scanner.stack[scanner.depth - 1];
            const start = frame.value_start;
            if (frame.is_object) {
                const field = frame.field orelse continue;
                const is_null = std.mem.startsWith(u8, scanner.text[start..], "null");
                if (!field.mayGo(is_null)) continue;
                scanner.said.forgive("{s}; left out", .{scanner.diagnostic.message.text()});
                try lenience.hideKey(frame.key_start);
                try scanner.skipValue(start);
                return;
            }
            const substitute = frame.substitute orelse continue;
            if (lenience.broken.count() == Lenience.broken_count_max) return err;
            try scanner.skipValue(start);
            const reason = scanner.diagnostic.message.text();
            if (frame.list) |list|
                try lenience.leaveOut(list, @intCast(frame.count - 1), .{ .reason = reason })
            else
                scanner.said.forgive("{s}; left out", .{reason});
            return lenience.replaceElement(start, scanner.offset, substitute);
        }
        return err;
    }

    /// Passes over the value at `start`, of the innermost container.
    fn skipValue(scanner: *Scanner, start: usize) Error!void {
        const depth = scanner.depth;
        scanner.offset = start;
        try scanner.value(&.any);
        while (scanner.depth > depth) try scanner.step();
    }

    /// Reads a string and returns what is between its quotes, escapes untouched.
    fn readString(scanner: *Scanner) error{InvalidInput}![]const u8 {
        assert(scanner.text[scanner.offset] == '"');
        scanner.offset += 1;
        const start = scanner.offset;
        while (true) {
            scanner.offset += plainLength(scanner.text[scanner.offset..]);
            const byte = scanner.peek() orelse return scanner.syntax("the text ends in a string");
            switch (byte) {
                '"' => {
                    const content = scanner.text[start..scanner.offset];
                    scanner.offset += 1;
                    return content;
                },
                '\\' => try scanner.skipEscape(),
                else => return scanner.syntax("a control character in a string"),
            }
        }
    }

    fn skipEscape(scanner: *Scanner) error{InvalidInput}!void {
        const rest = scanner.text[scanner.offset..];
        if (rest.len < 2) return scanner.syntax("the text ends in a string");
        switch (rest[1]) {
            '"', '\\', '/', 'b', 'f', 'n', 'r', 't' => scanner.offset += 2,
            'u' => {
                if (escapes.readHex(rest) == null) {
                    return scanner.syntax("a bad escape in a string");
                }
                scanner.offset += 6;
            },
            else => return scanner.syntax("a bad escape in a string"),
        }
    }

    /// -? (0 | [1-9][0-9]*) (. [0-9]+)? ([eE] [+-]? [0-9]+)?
    fn skipNumber(scanner: *Scanner) error{InvalidInput}!void {
        if (scanner.peek() == '-') scanner.offset += 1;
        const leading_zero = scanner.peek() == '0';
        const digit_count = scanner.skipDigits();
        if (digit_count == 0 or (leading_zero and digit_count > 1)) {
            return scanner.syntax("a bad number");
        }
        if (scanner.peek() == '.') {
            scanner.offset += 1;
            if (scanner.skipDigits() == 0) return scanner.syntax("a bad number");
        }
        if (scanner.peek() == 'e' or scanner.peek() == 'E') {
            scanner.offset += 1;
            if (scanner.peek() == '+' or scanner.peek() == '-') scanner.offset += 1;
            if (scanner.skipDigits() == 0) return scanner.syntax("a bad number");
        }
    }

    fn skipDigits(scanner: *Scanner) usize {
        const start = scanner.offset;
        while (scanner.peek()) |byte| {
            if (!std.ascii.isDigit(byte)) break;
            scanner.offset += 1;
        }
        return scanner.offset - start;
    }

    fn skipSpace(scanner: *Scanner) void {
        while (scanner.peek()) |byte| switch (byte) {
            ' ', '\t', '\n', '\r' => scanner.offset += 1,
            else => return,
        };
    }

    fn expect(scanner: *Scanner, byte: u8, comptime what: []const u8) error{InvalidInput}!void {
        if (scanner.peek() != byte) return scanner.syntax(what ++ " is expected");
        scanner.offset += 1;
    }

    fn peek(scanner: *const Scanner) ?u8 {
        if (scanner.offset == scanner.text.len) return null;
        return scanner.text[scanner.offset];
    }

    /// The text is not JSON.
    fn syntax(scanner: *Scanner, comptime what: []const u8) error{InvalidInput} {
        scanner.is_fatal = true;
        const before = scanner.text[0..scanner.offset];
        const line_start = if (std.mem.findScalarLast(u8, before, '\n')) |index| index + 1 else 0;
        return scanner.diagnostic.invalid("JSON line {d}, byte {d}: " ++ what, .{
            std.mem.countScalar(u8, before, '\n') + 1, scanner.offset - line_start + 1,
        });
    }

    /// The text is JSON, but not what the rule wants.
    fn wrong(
        scanner: *const Scanner,
        comptime what: []const u8,
        arguments: anytype,
    ) error{InvalidInput} {
        const path: Path = .{ .scanner = scanner };
        return scanner.diagnostic.invalid("{f}: " ++ what, .{path} ++ arguments);
    }

    fn unexpected(scanner: *const Scanner, rule: *const Rule) error{InvalidInput} {
        return scanner.wrong("{s} is expected", .{switch (rule.*) {
            .any => unreachable,
            .boolean => "true or false",
            .string, .word => "a string",
            .number, .positive => "a number",
            .whole, .reference => "a whole number",
            .vector, .doubles, .array => "a list",
            .object => "an object",
        }});
    }
};

/// Prints where the scanner is, as in `meshes[0].primitives[2].mode`.
const Path = struct {
    scanner: *const Scanner,

    /// What lies deeper is not worth the space.
    const depth_shown_max = 12;

    /// Called by `{f}`.
    pub fn format(path: Path, writer: *std.Io.Writer) std.Io.Writer.Error!void {
        const frames = path.scanner.stack[0..@min(path.scanner.depth, depth_shown_max)];
        if (frames.len == 0) try writer.writeAll("the document");
        for (frames, 0..) |*frame, index| {
            if (!frame.is_object) {
                try writer.print("[{d}]", .{frame.count -| 1});
                continue;
            }
            if (index > 0) try writer.writeByte('.');
            if (isPlain(frame.key)) {
                try writer.writeAll(frame.key);
            } else try writer.print("{f}", .{diagnostic_data.quote(frame.key)});
        }
    }

    fn isPlain(key: []const u8) bool {
        for (key) |byte| if (!std.ascii.isAlphanumeric(byte) and byte != '_') return false;
        return key.len > 0 and key.len <= diagnostic_data.name_bytes_max;
    }
};

/// Bytes before the first quote, backslash or control character.
fn plainLength(text: []const u8) usize {
    const width = 16;
    const Chunk = @Vector(width, u8);
    var offset: usize = 0;
    while (text.len - offset >= width) : (offset += width) {
        const chunk: Chunk = text[offset..][0..width].*;
        const special = (chunk == @as(Chunk, @splat('"'))) |
            (chunk == @as(Chunk, @splat('\\'))) |
            (chunk < @as(Chunk, @splat(' ')));
        if (@reduce(.Or, special)) break;
    }
    while (offset < text.len) : (offset += 1) switch (text[offset]) {
        '"', '\\', 0...0x1f => break,
        else => {},
    };
    return offset;
}

test "the grammar is JSON's, no more and no less" {
    const good = [_][]const u8{
        "{}",                "[]",                        " \t\r\n[ ] ",
        "0",                 "-0.5e+10",                  "1E5",
        "\"\"",              "\"\\u00e9\\n\\\"\\\\\\/\"", "[1,[2,{\"a\":null}],true,false]",
        "{\"a\":1,\"a\":2}", "\"\u{10ffff}\"",            "\"0123456789abcdef0123456789\"",
    };
    for (good) |text| {
        var diagnostic: Diagnostic = .{};
        _ = try check(text, &.any, &diagnostic);
    }
    const bad = [_][]const u8{
        "",         " ",        "{",                "[1,]",      "{\"a\":1,}",  "[1 2]",
        "nan",      "-inf",     "NaN",              "-",         "01",          "1.",
        ".5",       "1e",       "+1",               "0x1",       "'a'",         "{a:1}",
        "{\"a\"}",  "{\"a\":}", "[1]]",             "{} {}",     "tru",         "nulll",
        "\"",       "\"\\\"",   "\"\\x\"",          "\"\\u12\"", "\"\\u12g4\"", "\"\n\"",
        "\"\x00\"", "\xff",     "\"\xff\"",         "[1}",       "{]",          "\x00",
        "{1:2}",    "[,1]",     "\"\xed\xa0\x80\"", "/**/1",     "1/",          "true1",
    };
    for (bad) |text| {
        var diagnostic: Diagnostic = .{};
        try std.testing.expectError(error.InvalidInput, check(text, &.any, &diagnostic));
        try std.testing.expect(diagnostic.message.text().len > 0);
    }
}

test "depth has a limit" {
    var diagnostic: Diagnostic = .{};
    const open: [depth_max]u8 = @splat('[');
    const shut: [depth_max]u8 = @splat(']');
    _ = try check(&(open ++ shut), &.any, &diagnostic);
    const deeper = check("[" ++ open ++ shut ++ "]", &.any, &diagnostic);
    try std.testing.expectError(error.InvalidInput, deeper);
}

const test_rule: Rule = .{ .object = &.{ .fields = &.{
    .{ .name = "list", .rule = .{ .array = .{ .item = &test_item, .list = 3 } } },
    .{ .name = "one", .rule = .{ .reference = .{ .list = 3, .role = .root } } },
    .{ .name = "size", .rule = .whole, .required = true },
    .{ .name = "range", .rule = .positive },
    .{ .name = "mode", .rule = .{ .word = &.{ "A", "B" } } },
} } };
const test_item: Rule = .{ .object = &.{ .fields = &.{
    .{ .name = "v", .rule = .{ .vector = 2 } },
    .{ .name = "on", .rule = .boolean },
    .{ .name = "to", .rule = .{ .reference = .{ .list = 3, .role = .child } } },
} } };

test "a rule is held, and the message names the place" {
    const cases = [_]struct { []const u8, []const u8 }{
        .{ "[]", "the document: an object is expected" },
        .{ "{}", "the document: 'size' is missing" },
        .{ "{\"size\":-1}", "size: -1 is not a whole number from 0 to 2^53 - 1" },
        .{ "{\"size\":\"0\"}", "size: a whole number is expected" },
        .{ "{\"size\":1,\"size\":1}", "size: stands twice" },
        .{ "{\"list\":[{},{\"v\":[1]}]}", "list[1].v: 2 numbers are expected" },
        .{ "{\"list\":[{},{\"v\":[1,2,3]}]}", "list[1].v[1]: has over 2 elements" },
        .{ "{\"list\":[{\"v\":[1,1e39]}]}", "list[0].v[1]: 1e39 is out of range" },
        .{ "{\"list\":[{\"v\":[1,null]}]}", "list[0].v[1]: a number is expected" },
        .{ "{\"list\":[{\"on\":0}]}", "list[0].on: true or false is expected" },
        .{ "{\n\"list\": tru}", "JSON line 2, byte 9: a value is expected" },
    };
    for (cases) |case| {
        var diagnostic: Diagnostic = .{};
        try std.testing.expectError(error.InvalidInput, check(case[0], &test_rule, &diagnostic));
        try std.testing.expectEqualStrings(case[1], diagnostic.message.text());
    }
    var diagnostic: Diagnostic = .{};
    const text = "{\"size\":400e-2,\"list\":[{\"x\":{}},{}],\"mode\":\"C\",\"range\":0}";
    const lengths = (try check(text, &test_rule, &diagnostic)).lengths;
    try std.testing.expectEqual(2, lengths[3]);
    const warnings = [_][]const u8{
        "mode: 'C' is not known, ignored", "range: 0 is not above 0, ignored",
    };
    for (warnings, diagnostic.warnings[0..2]) |expected, *warning| {
        try std.testing.expectEqualStrings(expected, warning.text());
    }
}

test checkReferences {
    const gpa = std.testing.allocator;
    const cases = [_]struct { []const u8, []const u8 }{
        .{ "{\"size\":1,\"list\":[{},{\"to\":0}],\"one\":1}", "" },
        .{ "{\"size\":1,\"list\":[{},{\"to\":2}]}", "list[1].to: 2 of 2" },
        .{ "{\"size\":1,\"list\":[{\"to\":1},{\"to\":1}]}", "list[1].to: 1 has two parents" },
        .{
            "{\"size\":1,\"list\":[{},{\"to\":0}],\"one\":0}",
            "node 0 is a root and a child at once",
        },
    };
    for (cases) |case| {
        var diagnostic: Diagnostic = .{};
        const lengths = (try check(case[0], &test_rule, &diagnostic)).lengths;
        if (checkReferences(gpa, case[0], &test_rule, lengths, "node", &diagnostic)) {
            try std.testing.expectEqualStrings("", case[1]);
        } else |err| {
            try std.testing.expectEqual(error.InvalidInput, err);
            try std.testing.expectEqualStrings(case[1], diagnostic.message.text());
        }
    }
}
