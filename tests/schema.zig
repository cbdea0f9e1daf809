//! Checks JSON against a schema: of draft 2020-12, the keywords that docs/*.schema.json have.
//!
//! In: both as parsed JSON. Out: an error that has said where and what. A keyword that is not known
//! is an error, too: it would be a rule that nobody checks.

const std = @import("std");
const Value = std.json.Value;

pub const Error = error{ SchemaUnknown, SchemaBroken };

const Keyword = enum {
    @"$schema",
    @"$defs",
    @"$ref",
    title,
    description,
    type,
    @"enum",
    oneOf,
    properties,
    required,
    additionalProperties,
    items,
    minItems,
    maxItems,
    minLength,
    maxLength,
    minimum,
};

const Type = enum { null, boolean, object, array, number, integer, string };

/// Checks a value against a schema. Both are parsed with numbers as such.
pub fn check(root: *const Value, value: *const Value) Error!void {
    const checker: Checker = .{ .root = root };
    return checker.check(root, value);
}

const Checker = struct {
    /// Whose `$defs` references are to.
    root: *const Value,
    /// Says what is wrong.
    is_loud: bool = true,

    fn check(checker: Checker, schema: *const Value, value: *const Value) Error!void {
        var rules = schema.object.iterator();
        while (rules.next()) |rule| {
            const name = rule.key_ptr.*;
            const keyword = std.meta.stringToEnum(Keyword, name) orelse {
                checker.say("the schema has", name);
                return error.SchemaUnknown;
            };
            if (try checker.obeys(schema, keyword, rule.value_ptr, value)) continue;
            checker.say("against", name);
            return error.SchemaBroken;
        }
    }

    fn say(checker: Checker, what: []const u8, name: []const u8) void {
        if (checker.is_loud) std.debug.print("{s} '{s}'\n", .{ what, name });
    }

    fn obeys(
        checker: Checker,
        schema: *const Value,
        keyword: Keyword,
        rule: *const Value,
        value: *const Value,
    ) Error!bool {
        switch (keyword) {
            .@"$schema", .@"$defs", .title, .description => return true,
            .@"$ref" => {
                const name = std.mem.cutPrefix(u8, rule.string, "#/$defs/") orelse
                    return error.SchemaUnknown;
                const definition = checker.root.object.getPtr("$defs").?.object.getPtr(name) orelse
                    return error.SchemaUnknown;
                try checker.check(definition, value);
                return true;
            },
            .type => return if (rule.* == .array) for (rule.array.items) |*one| {
                if (try hasType(one.string, value)) break true;
            } else false else hasType(rule.string, value),
            .@"enum" => return for (rule.array.items) |*one| {
                if (isSame(one, value)) break true;
            } else false,
            .oneOf => return checker.obeysOne(rule, value),
            .properties => {
                if (value.* != .object) return true;
                var fields = value.object.iterator();
                while (fields.next()) |field| {
                    const property = rule.object.getPtr(field.key_ptr.*) orelse continue;
                    checker.check(property, field.value_ptr) catch |err| {
                        checker.say("in", field.key_ptr.*);
                        return err;
                    };
                }
                return true;
            },
            .required => {
                if (value.* != .object) return true;
                return for (rule.array.items) |*name| {
                    if (value.object.contains(name.string)) continue;
                    checker.say("no", name.string);
                    break false;
                } else true;
            },
            .additionalProperties => {
                if (rule.bool or value.* != .object) return true;
                const known = &schema.object.getPtr("properties").?.object;
                for (value.object.keys()) |name| {
                    if (known.contains(name)) continue;
                    checker.say("not in the schema:", name);
                    return false;
                }
                return true;
            },
            .items => {
                if (value.* != .array) return true;
                for (value.array.items) |*item| try checker.check(rule, item);
                return true;
            },
            .minItems => return value.* != .array or value.array.items.len >= rule.integer,
            .maxItems => return value.* != .array or value.array.items.len <= rule.integer,
            .minLength => return value.* != .string or value.string.len >= rule.integer,
            .maxLength => return value.* != .string or value.string.len <= rule.integer,
            .minimum => return (numberOf(value) orelse return true) >= numberOf(rule).?,
        }
    }

    fn obeysOne(checker: Checker, rule: *const Value, value: *const Value) Error!bool {
        const quiet: Checker = .{ .root = checker.root, .is_loud = false };
        var count: usize = 0;
        for (rule.array.items) |*one| {
            quiet.check(one, value) catch |err| switch (err) {
                error.SchemaUnknown => return err,
                error.SchemaBroken => continue,
            };
            count += 1;
        }
        if (count == 0) for (rule.array.items) |*one| checker.check(one, value) catch {};
        return count == 1;
    }
};

fn hasType(name: []const u8, value: *const Value) error{SchemaUnknown}!bool {
    return switch (std.meta.stringToEnum(Type, name) orelse return error.SchemaUnknown) {
        .null => value.* == .null,
        .boolean => value.* == .bool,
        .object => value.* == .object,
        .array => value.* == .array,
        .string => value.* == .string,
        .number => numberOf(value) != null,
        .integer => if (numberOf(value)) |number| @trunc(number) == number else false,
    };
}

fn isSame(left: *const Value, right: *const Value) bool {
    if (left.* == .string and right.* == .string)
        return std.mem.eql(u8, left.string, right.string);
    return left.* == .null and right.* == .null;
}

fn numberOf(value: *const Value) ?f64 {
    return switch (value.*) {
        .integer => |number| @floatFromInt(number),
        .float => |number| number,
        else => null,
    };
}

test "each keyword refuses what it is there for" {
    const Case = struct { schema: []const u8, good: []const u8, bad: []const u8 };
    for ([_]Case{
        .{ .schema = "{\"type\":\"integer\"}", .good = "2.0", .bad = "2.5" },
        .{ .schema = "{\"type\":[\"null\",\"string\"]}", .good = "null", .bad = "0" },
        .{ .schema = "{\"enum\":[\"a\",null]}", .good = "\"a\"", .bad = "\"b\"" },
        .{ .schema = "{\"minimum\":1}", .good = "1", .bad = "0.5" },
        .{ .schema = "{\"minLength\":1}", .good = "\"a\"", .bad = "\"\"" },
        .{ .schema = "{\"maxLength\":1}", .good = "\"a\"", .bad = "\"ab\"" },
        .{ .schema = "{\"minItems\":1}", .good = "[1]", .bad = "[]" },
        .{ .schema = "{\"maxItems\":1}", .good = "[1]", .bad = "[1,2]" },
        .{ .schema = "{\"required\":[\"a\"]}", .good = "{\"a\":1}", .bad = "{\"b\":1}" },
        .{
            .schema = "{\"properties\":{\"a\":{\"type\":\"null\"}},\"additionalProperties\":false}",
            .good = "{\"a\":null}",
            .bad = "{\"b\":null}",
        },
        .{
            .schema = "{\"properties\":{\"a\":{\"type\":\"null\"}}}",
            .good = "{}",
            .bad = "{\"a\":1}",
        },
        .{ .schema = "{\"items\":{\"type\":\"null\"}}", .good = "[null]", .bad = "[null,1]" },
        .{
            .schema = "{\"oneOf\":[{\"minimum\":3},{\"type\":\"integer\"}]}",
            .good = "1",
            .bad = "3",
        },
        .{
            .schema = "{\"$ref\":\"#/$defs/a\",\"$defs\":{\"a\":{\"type\":\"boolean\"}}}",
            .good = "true",
            .bad = "1",
        },
    }) |case| {
        const gpa = std.testing.allocator;
        const schema = try std.json.parseFromSlice(Value, gpa, case.schema, .{});
        defer schema.deinit();
        for ([_][]const u8{ case.good, case.bad }, [_]bool{ true, false }) |text, is_good| {
            const value = try std.json.parseFromSlice(Value, gpa, text, .{});
            defer value.deinit();
            const checker: Checker = .{ .root = &schema.value, .is_loud = false };
            const result = checker.check(&schema.value, &value.value);
            if (is_good) try result else try std.testing.expectError(error.SchemaBroken, result);
        }
    }
}

test "an unknown keyword is an error" {
    const gpa = std.testing.allocator;
    const schema = try std.json.parseFromSlice(Value, gpa, "{\"maximum\":3}", .{});
    defer schema.deinit();
    const checker: Checker = .{ .root = &schema.value, .is_loud = false };
    const result = checker.check(&schema.value, &.null);
    try std.testing.expectError(error.SchemaUnknown, result);
}
