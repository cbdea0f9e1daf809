//! The syntax that all commands share: long and short flags, their values, `--`, other words.
//!
//! In: the arguments, and a table of flags. Out: one flag with its value or one word at a time. The
//! errors name what was meant where a name is nearly right.

const std = @import("std");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const nearest = @import("nearest.zig").nearest;
const quote = @import("../diagnostic.zig").quote;

/// One option of a command, by the names of the enumeration `Id`.
pub fn Flag(comptime Id: type) type {
    return struct {
        id: Id,
        /// With its dashes.
        long: []const u8,
        /// 0: none.
        short: u8 = 0,
        has_value: bool = true,
    };
}

/// Reads arguments by a table of flags.
pub fn Arguments(comptime Id: type, comptime flags: []const Flag(Id)) type {
    return struct {
        const Self = @This();

        arguments: []const [:0]const u8,
        diagnostic: *Diagnostic,
        /// What errors tell the user to look at.
        help: []const u8,
        /// Of the next argument.
        index: usize = 0,
        /// What is left of several short flags in one.
        shorts: []const u8 = "",
        flags_ended: bool = false,

        pub const Argument = union(enum) {
            word: []const u8,
            /// The value is empty where the flag has none.
            flag: struct { flag: Flag(Id), value: []const u8 },
        };

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
            flag: Flag(Id),
            value: []const u8,
            comptime expected: []const u8,
        ) error{UsageInvalid} {
            return reader.fail("option '{s}': {f} is not " ++ expected, .{
                flag.long, quote(value),
            });
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
            for (flags) |flag| {
                if (!std.mem.eql(u8, flag.long, name)) continue;
                const value = if (equals) |at| argument[at + 1 ..] else null;
                if (flag.has_value) return .{ .flag = .{
                    .flag = flag,
                    .value = value orelse try reader.valueOf(flag.long),
                } };
                if (value == null) return .{ .flag = .{ .flag = flag, .value = "" } };
                return reader.fail("option '{s}' takes no value", .{flag.long});
            }
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
            const flag = for (flags) |flag| {
                if (flag.short == letter) break flag;
            } else {
                const whole = reader.arguments[reader.index - 1];
                return reader.fail("unknown option {f}", .{quote(whole)});
            };
            if (flag.has_value) return .{ .flag = .{
                .flag = flag,
                .value = if (rest.len > 0) rest else try reader.valueOf(&.{ '-', letter }),
            } };
            reader.shorts = rest;
            return .{ .flag = .{ .flag = flag, .value = "" } };
        }

        fn valueOf(reader: *Self, name: []const u8) error{UsageInvalid}![]const u8 {
            return reader.take() orelse reader.fail("option '{s}' needs a value", .{name});
        }
    };
}
