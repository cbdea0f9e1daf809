//! The syntax that all commands share: long and short flags, their values, `--`, other words.
//!
//! In: the arguments, and a table of flags. Out: one flag with its value or one word at a time. The
//! errors name what was meant where a name is nearly right.

const std = @import("std");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const nearest = @import("nearest.zig").nearest;
const quote = @import("../diagnostic.zig").quote;
const Range = @import("../settings.zig").Range;

/// One option of a command, in the words of its help.
pub const Option = struct {
    /// `-f, --flag VALUE`, perhaps without a letter or a value.
    usage: []const u8,
    /// Words that its value may be, for shells to offer: all, or those that are not names.
    words: []const []const u8 = &.{},
    /// What it does: lines of the help's right column.
    help: []const u8,
    /// Names that other programs have for it, with their dashes: understood.
    also: []const []const u8 = &.{},
    /// Names of options of theirs that take something else: the answer is this one.
    meant: []const []const u8 = &.{},
};

/// What the usage of an option says.
pub const Flag = struct {
    /// With its dashes.
    long: []const u8,
    /// 0: none.
    short: u8,
    takes_value: bool,
    /// What the help calls its value; empty: it takes none.
    value: []const u8,
    also: []const []const u8,
    meant: []const []const u8,

    /// Of an option.
    pub fn of(comptime option: Option) Flag {
        const usage = option.usage;
        const has_short = usage[1] != '-';
        var words = std.mem.tokenizeScalar(u8, usage[if (has_short) 4 else 0..], ' ');
        const name = words.next().?;
        const value = words.next() orelse "";
        return .{
            .long = name,
            .short = if (has_short) usage[1] else 0,
            .takes_value = value.len > 0,
            .value = value,
            .also = option.also,
            .meant = option.meant,
        };
    }

    /// Whether that is one of its names, but for the dashes in front.
    pub fn isNamed(flag: *const Flag, name: []const u8) bool {
        return std.mem.eql(u8, flag.long[2..], name) or holds(flag.also, name);
    }

    /// Whether it is the answer to that name.
    pub fn isMeant(flag: *const Flag, name: []const u8) bool {
        return holds(flag.meant, name);
    }

    fn holds(names: []const []const u8, name: []const u8) bool {
        for (names) |other| if (std.mem.eql(u8, other[2..], name)) return true;
        return false;
    }
};

/// The options under one heading of the help.
pub const Section = struct { title: []const u8, options: []const Option };

/// Where the right column of the help begins.
const help_column = 27;

/// The part of the help that describes the flags.
pub fn helpOf(comptime sections: []const Section) []const u8 {
    comptime {
        @setEvalBranchQuota(1 << 20);
        var text: []const u8 = "";
        for (sections) |section| {
            text = text ++ "\n" ++ section.title ++ "\n";
            for (section.options) |option| {
                const indent = if (option.usage[1] == '-') "      " else "  ";
                var left: []const u8 = indent ++ option.usage;
                if (left.len >= help_column) {
                    text = text ++ left ++ "\n";
                    left = "";
                }
                var lines = std.mem.splitScalar(u8, option.help, '\n');
                while (lines.next()) |line| {
                    const gap: [help_column - left.len]u8 = @splat(' ');
                    text = text ++ left ++ gap ++ line ++ "\n";
                    left = "";
                }
            }
        }
        return text;
    }
}

/// The names of an enumeration, for an option's `words`.
pub fn wordsOf(comptime Enum: type) []const []const u8 {
    return comptime std.meta.fieldNames(Enum);
}

/// `png, ppm or pfm`: the names of an enumeration, for messages.
pub fn namesOf(comptime Enum: type) []const u8 {
    comptime {
        const names = std.meta.fieldNames(Enum);
        var text: []const u8 = names[0];
        for (names[1..], 2..) |name, count| {
            text = text ++ (if (count == names.len) " or " else ", ") ++ name;
        }
        return text;
    }
}

/// A decimal integer of the range, digits only.
pub fn integer(text: []const u8, range: Range) ?u32 {
    if (text.len == 0) return null;
    for (text) |byte| if (!std.ascii.isDigit(byte)) return null;
    const value = std.fmt.parseInt(u32, text, 10) catch return null;
    return if (range.holds(value)) value else null;
}

/// Reads arguments by a table of flags.
pub fn Arguments(comptime sections: []const Section) type {
    return struct {
        const Self = @This();

        /// The flags of all sections.
        pub const flags: []const Flag = flags: {
            @setEvalBranchQuota(1 << 16);
            var all: []const Flag = &.{};
            for (sections) |section| {
                for (section.options) |option| all = all ++ .{Flag.of(option)};
            }
            break :flags all;
        };

        /// The flags by their names, without the first dashes and with underscores for the others.
        pub const Id = Id: {
            var names: [flags.len][]const u8 = undefined;
            var numbers: [flags.len]u8 = undefined;
            for (flags, &names, &numbers, 0..) |flag, *name, *number_of, index| {
                var tag = flag.long[2..].*;
                std.mem.replaceScalar(u8, &tag, '-', '_');
                const constant = tag;
                name.* = &constant;
                number_of.* = index;
            }
            break :Id @Enum(u8, .exhaustive, &names, &numbers);
        };

        /// A flag as it stands among the arguments.
        pub const Given = struct {
            id: Id,
            long: []const u8,
            /// Empty where the flag has none.
            value: []const u8,
        };

        pub const Argument = union(enum) { word: []const u8, flag: Given };

        arguments: []const [:0]const u8,
        diagnostic: *Diagnostic,
        /// What errors tell the user to look at.
        help: []const u8,
        /// Of the next argument.
        index: usize = 0,
        /// What is left of several short flags in one.
        shorts: []const u8 = "",
        flags_ended: bool = false,

        /// The next flag or word; null after the last.
        pub fn next(reader: *Self) error{UsageInvalid}!?Argument {
            if (reader.shorts.len > 0) return try reader.short();
            const argument = reader.take() orelse return null;
            if (reader.flags_ended or argument.len < 2 or argument[0] != '-')
                return .{ .word = argument };
            if (std.mem.eql(u8, argument, "--")) {
                reader.flags_ended = true;
                return reader.next();
            }
            if (argument[1] == '-') return try reader.long(argument);
            reader.shorts = argument[1..];
            return try reader.short();
        }

        /// A usage error.
        pub fn fail(
            reader: *const Self,
            comptime format: []const u8,
            arguments: anytype,
        ) error{UsageInvalid} {
            const all = arguments ++ .{reader.help};
            return reader.diagnostic.fail(error.UsageInvalid, format ++ " (see {s})", all);
        }

        /// The error of a value that is not what it should be.
        pub fn bad(
            reader: *const Self,
            given: Given,
            comptime expected: []const u8,
        ) error{UsageInvalid} {
            const parts = .{ given.long, quote(given.value) };
            return reader.fail("option '{s}': {f} is not " ++ expected, parts);
        }

        /// The value as a number of a range.
        pub fn number(
            reader: *const Self,
            given: Given,
            comptime range: Range,
        ) error{UsageInvalid}!u32 {
            return integer(given.value, range) orelse reader.bad(given, comptime range.text());
        }

        /// The value as one of the names of an enumeration.
        pub fn choice(
            reader: *const Self,
            given: Given,
            comptime Enum: type,
        ) error{UsageInvalid}!Enum {
            return std.meta.stringToEnum(Enum, given.value) orelse
                reader.bad(given, comptime namesOf(Enum));
        }

        /// The value as text that is not empty.
        pub fn text(
            reader: *const Self,
            given: Given,
            comptime expected: []const u8,
        ) error{UsageInvalid}![]const u8 {
            return if (given.value.len > 0) given.value else reader.bad(given, expected);
        }

        fn take(reader: *Self) ?[]const u8 {
            if (reader.index == reader.arguments.len) return null;
            reader.index += 1;
            return reader.arguments[reader.index - 1];
        }

        /// `--flag`, `--flag=value` or `--flag value`.
        fn long(reader: *Self, argument: []const u8) error{UsageInvalid}!Argument {
            const equals = std.mem.findScalar(u8, argument, '=');
            const name = argument[0 .. equals orelse argument.len];
            const value = if (equals) |at| argument[at + 1 ..] else null;
            for (flags, 0..) |flag, index| {
                if (!flag.isNamed(name[2..])) continue;
                if (!flag.takes_value and value != null)
                    return reader.fail("option '{s}' takes no value", .{name});
                return reader.give(index, value, name);
            }
            for (flags) |flag| if (flag.isMeant(name[2..]))
                return reader.fail("option {f} is '{s}' here", .{ quote(name), flag.long });
            var names: [flags.len][]const u8 = undefined;
            for (&names, flags) |*candidate, flag| candidate.* = flag.long;
            if (nearest(name, &names)) |candidate| {
                return reader.fail("unknown option {f}, did you mean '{s}'?", .{
                    quote(name), candidate,
                });
            }
            return reader.fail("unknown option {f}", .{quote(name)});
        }

        /// `-f`, `-fvalue`, `-f value`, or several flags without values in one.
        fn short(reader: *Self) error{UsageInvalid}!Argument {
            const letter = reader.shorts[0];
            const rest = reader.shorts[1..];
            reader.shorts = "";
            for (flags, 0..) |flag, index| {
                if (flag.short != letter) continue;
                if (!flag.takes_value) reader.shorts = rest;
                return reader.give(index, if (rest.len > 0) rest else null, &.{ '-', letter });
            }
            return reader.fail("unknown option {f}", .{quote(reader.arguments[reader.index - 1])});
        }

        /// The flag with that index, called `name`; its value is the next argument if need be.
        fn give(
            reader: *Self,
            index: usize,
            value: ?[]const u8,
            name: []const u8,
        ) error{UsageInvalid}!Argument {
            const flag = flags[index];
            return .{ .flag = .{
                .id = @fromBackingInt(@intCast(index)),
                .long = flag.long,
                .value = if (!flag.takes_value) "" else value orelse reader.take() orelse
                    return reader.fail("option '{s}' needs a value", .{name}),
            } };
        }
    };
}
