//! A command as its help describes it, for what is made of all of them: completions and the manual.
//!
//! In: the help's text, and the table that its middle is made of. Out: the parts of the text, and
//! the options one by one.

const std = @import("std");
const arguments = @import("arguments.zig");
const Flag = arguments.Flag;
const Option = arguments.Option;
const Section = arguments.Section;

/// One command.
pub const Page = struct {
    /// Empty: the one without a word, `render`.
    word: []const u8,
    /// What it does, in a line.
    summary: []const u8,
    /// Lines of its usage.
    usage: []const u8,
    /// What stands between that and the options, and after them.
    before: []const u8,
    after: []const u8,
    /// What it understands; its help may leave to another one to describe them.
    sections: []const Section,
    describes_options: bool,
    /// By option, sections one after the other.
    flags: []const Flag,
    /// What words may be besides options; null: names of files.
    words: ?[]const []const u8 = null,

    /// Of a command whose help begins with `raylane VERSION: SUMMARY` and `usage: `.
    pub fn of(
        comptime word: []const u8,
        comptime help: []const u8,
        comptime sections: []const Section,
        comptime words: ?[]const []const u8,
    ) Page {
        @setEvalBranchQuota(1 << 22);
        const options = arguments.helpOf(sections);
        const at = if (sections.len > 0) std.mem.find(u8, help, options) else null;
        const summary_end = std.mem.findScalar(u8, help, '\n').?;
        const usage_start = std.mem.find(u8, help, "usage: ").? + "usage: ".len;
        const usage_end = std.mem.findPos(u8, help, usage_start, "\n\n").?;
        return .{
            .word = word,
            .summary = help[std.mem.find(u8, help, ": ").? + 2 .. summary_end],
            .usage = help[usage_start..usage_end],
            .before = help[usage_end .. at orelse help.len],
            .after = if (at) |start| help[start + options.len ..] else "",
            .sections = sections,
            .describes_options = at != null,
            .flags = arguments.Arguments(sections).flags,
            .words = words,
        };
    }

    /// What to call it where every command has a word.
    pub fn name(page: *const Page) []const u8 {
        return if (page.word.len > 0) page.word else "render";
    }

    /// Its options, one by one.
    pub fn iterate(page: *const Page) Iterator {
        return .{ .page = page };
    }

    /// See `iterate`.
    pub const Iterator = struct {
        page: *const Page,
        section: usize = 0,
        option: usize = 0,
        flag: usize = 0,

        /// Null: there are no more.
        pub fn next(iterator: *Iterator) ?Entry {
            const sections = iterator.page.sections;
            if (iterator.section == sections.len) return null;
            const section = &sections[iterator.section];
            const entry: Entry = .{
                .section = if (iterator.option == 0) section.title else null,
                .option = &section.options[iterator.option],
                .flag = &iterator.page.flags[iterator.flag],
            };
            iterator.flag += 1;
            iterator.option += 1;
            if (iterator.option == section.options.len) {
                iterator.section += 1;
                iterator.option = 0;
            }
            return entry;
        }
    };
};

/// One option.
pub const Entry = struct {
    /// The heading that it is the first one under.
    section: ?[]const u8,
    option: *const Option,
    flag: *const Flag,

    /// What may follow it.
    pub const Kind = enum { nothing, words, words_or_file, file, folder, anything };

    /// By what the help calls its value, and the words of the table.
    pub fn kind(entry: *const Entry) Kind {
        const value = entry.flag.value;
        if (value.len == 0) return .nothing;
        const is_file = std.mem.startsWith(u8, value, "FILE") or std.mem.eql(u8, value, "OUT");
        if (entry.option.words.len > 0) return if (is_file) .words_or_file else .words;
        if (is_file) return .file;
        return if (std.mem.eql(u8, value, "DIR")) .folder else .anything;
    }
};

test "a page has all of its help, and each option once" {
    const sections: []const Section = &.{
        .{ .title = "One", .options = &.{
            .{ .usage = "-a, --all FILE", .help = "x", .words = &.{"none"} },
            .{ .usage = "--big", .help = "y" },
        } },
        .{ .title = "Two", .options = &.{.{ .usage = "--cut DIR", .help = "z" }} },
    };
    const help = "raylane 1.0: does it\n\nusage: raylane it\n       raylane it\n\nText.\n" ++
        comptime arguments.helpOf(sections) ++ "\nExit.\n";
    const page: Page = comptime .of("it", help, sections, null);
    try std.testing.expectEqualStrings("does it", page.summary);
    try std.testing.expectEqualStrings("raylane it\n       raylane it", page.usage);
    try std.testing.expectEqualStrings("\n\nText.\n", page.before);
    try std.testing.expectEqualStrings("\nExit.\n", page.after);
    var options = page.iterate();
    for (
        [_]Entry.Kind{ .words_or_file, .nothing, .folder },
        [_]?[]const u8{ "One", null, "Two" },
        [_][]const u8{ "--all", "--big", "--cut" },
    ) |kind, title, long| {
        const entry = options.next().?;
        try std.testing.expectEqual(kind, entry.kind());
        try std.testing.expectEqualDeep(title, entry.section);
        try std.testing.expectEqualStrings(long, entry.flag.long);
    }
    try std.testing.expectEqual(null, options.next());
    const short = "raylane 1.0: does it\n\nusage: raylane it\n\nText.\n";
    const bare: Page = comptime .of("it", short, &.{}, null);
    try std.testing.expectEqualStrings("\n\nText.\n", bare.before);
    try std.testing.expect(!bare.describes_options);
}
