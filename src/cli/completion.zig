//! Completion scripts for shells, made of the tables that the help is made of.
//!
//! In: the commands. Out: a script for bash, zsh or fish: what options there are, which words or
//! files may follow them, and what each is for, where the shell shows that.

const std = @import("std");
const cli = @import("../cli.zig");
const page_file = @import("page.zig");
const Entry = page_file.Entry;
const Page = page_file.Page;
const Writer = std.Io.Writer;

/// A shell that is known.
pub const Shell = enum { bash, zsh, fish };

/// What `raylane completion --help` prints.
pub const help: []const u8 = "raylane " ++ cli.version ++
    \\: prints a script that completes its options in a shell
    \\
    \\usage: raylane completion bash|zsh|fish
    \\
    \\For this shell alone, or wherever the shell looks for such files:
    \\
    \\  source <(raylane completion bash)
    \\  raylane completion bash > ~/.local/share/bash-completion/completions/raylane
    \\  raylane completion zsh > a folder of fpath, there called _raylane
    \\  raylane completion fish > ~/.config/fish/completions/raylane.fish
    \\
;

/// Writes the script.
pub fn write(writer: *Writer, shell: Shell, pages: []const Page) Writer.Error!void {
    return switch (shell) {
        .bash => writeBash(writer, pages),
        .zsh => writeZsh(writer, pages),
        .fish => writeFish(writer, pages),
    };
}

/// bash splits words at `=`, so that `--format=p` is three of them.
const bash_begin =
    \\# bash completion of raylane; made by 'raylane completion bash'
    \\_raylane() {
    \\    local cur=${COMP_WORDS[COMP_CWORD]} option= command=render
    \\    local kind=word words= options= others=
    \\    ((COMP_CWORD > 1)) && option=${COMP_WORDS[COMP_CWORD - 1]}
    \\    if [[ $cur == '=' ]]; then
    \\        cur=
    \\    elif [[ $option == '=' ]]; then
    \\        option=${COMP_WORDS[COMP_CWORD - 2]}
    \\    fi
    \\    if ((COMP_CWORD > 1)); then
    \\        case ${COMP_WORDS[1]} in
    \\
;

const bash_end =
    \\    esac
    \\    COMPREPLY=()
    \\    case $kind in
    \\    file) return ;;
    \\    folder)
    \\        compopt -o filenames 2>/dev/null
    \\        mapfile -t COMPREPLY < <(compgen -d -- "$cur")
    \\        return
    \\        ;;
    \\    words_or_file)
    \\        mapfile -t COMPREPLY < <(compgen -W "$words" -- "$cur")
    \\        return
    \\        ;;
    \\    words | anything) ;;
    \\    word)
    \\        words=$others
    \\        if [[ $cur == -* ]]; then
    \\            words=$options
    \\        elif ((COMP_CWORD == 1)); then
    \\            words=$commands
    \\            compopt -o filenames 2>/dev/null
    \\            mapfile -t COMPREPLY < <(compgen -W "$words" -- "$cur"; compgen -f -- "$cur")
    \\            return
    \\        elif [[ -z $words ]]; then
    \\            return
    \\        fi
    \\        ;;
    \\    esac
    \\    compopt +o default +o bashdefault 2>/dev/null
    \\    [[ -z $words ]] || mapfile -t COMPREPLY < <(compgen -W "$words" -- "$cur")
    \\}
    \\complete -o bashdefault -o default -F _raylane raylane
    \\
;

fn writeBash(writer: *Writer, pages: []const Page) Writer.Error!void {
    try writer.writeAll(bash_begin);
    for (pages) |*page| if (page.word.len > 0)
        try writer.print("        {s}) command={s} ;;\n", .{ page.word, page.word });
    try writer.writeAll("        esac\n    fi\n    local commands='");
    try writeCommands(writer, pages);
    try writer.writeAll("'\n    case $command in\n");
    for (pages) |*page| {
        try writer.print("    {s})\n        options='", .{page.name()});
        var options = page.iterate();
        while (options.next()) |entry| {
            if (entry.flag.short != 0) try writer.print("-{c} ", .{entry.flag.short});
            try writer.print("{s} ", .{entry.flag.long});
        }
        try writer.writeAll("'\n");
        if (page.words) |words| {
            try writer.writeAll("        others='");
            try writeWords(writer, words);
            try writer.writeAll("'\n");
        }
        try writer.writeAll("        case $option in\n");
        var values = page.iterate();
        while (values.next()) |entry| {
            const kind = entry.kind();
            if (kind == .nothing) continue;
            try writer.writeAll("        ");
            if (entry.flag.short != 0) try writer.print("-{c} | ", .{entry.flag.short});
            try writer.print("{s}) kind={t}", .{ entry.flag.long, kind });
            if (entry.option.words.len > 0) {
                try writer.writeAll(" words='");
                try writeWords(writer, entry.option.words);
                try writer.writeByte('\'');
            }
            try writer.writeAll(" ;;\n");
        }
        try writer.writeAll("        esac\n        ;;\n");
    }
    try writer.writeAll(bash_end);
}

const zsh_begin =
    \\#compdef raylane
    \\# zsh completion of raylane; made by 'raylane completion zsh'
    \\_raylane_words_or_files() {
    \\    _alternative "words:word:($*)" 'files:file:_files'
    \\}
    \\_raylane() {
    \\    local command=render
    \\    if (( CURRENT > 2 )); then
    \\        case $words[2] in
    \\
;

const zsh_end =
    \\    esac
    \\}
    \\if [[ $funcstack[1] == _raylane ]]; then
    \\    _raylane "$@"
    \\else
    \\    compdef _raylane raylane
    \\fi
    \\
;

fn writeZsh(writer: *Writer, pages: []const Page) Writer.Error!void {
    try writer.writeAll(zsh_begin);
    for (pages) |*page| if (page.word.len > 0)
        try writer.print("            {s}) command={s} ;;\n", .{ page.word, page.word });
    try writer.writeAll(
        \\        esac
        \\    fi
        \\    if [[ $command != render ]]; then
        \\        words=("${(@)words[2,-1]}")
        \\        (( CURRENT-- ))
        \\    fi
        \\    case $command in
        \\
    );
    for (pages) |*page| {
        try writer.print("    {s})\n        _arguments -s -S :", .{page.name()});
        var options = page.iterate();
        while (options.next()) |entry| {
            try writer.writeAll(" \\\n            ");
            try writeZshOption(writer, &entry);
        }
        try writer.writeAll(" \\\n            ");
        if (page.word.len == 0) {
            try writer.writeAll("'1: : _raylane_words_or_files ");
            try writeCommands(writer, pages);
            try writer.writeAll("' '*:file:_files'");
        } else if (page.words) |words| {
            try writer.writeAll("'*: :(");
            try writeWords(writer, words);
            try writer.writeAll(")'");
        } else try writer.writeAll("'*:file:_files'");
        try writer.writeAll("\n        ;;\n");
    }
    try writer.writeAll(zsh_end);
}

/// `'(-o --output)'{-o+,--output=}'[what it does]:FILE:_files'`.
fn writeZshOption(writer: *Writer, entry: *const Entry) Writer.Error!void {
    const flag = entry.flag;
    const takes_value = flag.value.len > 0;
    const equals: []const u8 = if (takes_value) "=" else "";
    const plus: []const u8 = if (takes_value) "+" else "";
    if (flag.short != 0) {
        try writer.print("'(-{c} {s})'{{-{c}{s},{s}{s}}}'[", .{
            flag.short, flag.long, flag.short, plus, flag.long, equals,
        });
    } else try writer.print("'{s}{s}[", .{ flag.long, equals });
    try writeEscaped(writer, entry.option.help, &.{
        .{ "'", "'\\''" }, .{ "[", "\\[" }, .{ "]", "\\]" }, .{ "\n", " " },
    });
    try writer.writeByte(']');
    if (takes_value) {
        try writer.writeByte(':');
        try writeEscaped(writer, flag.value, &.{.{ ":", "\\:" }});
        try writer.writeByte(':');
    }
    switch (entry.kind()) {
        .nothing, .anything => {},
        .file => try writer.writeAll("_files"),
        .folder => try writer.writeAll("_files -/"),
        .words => {
            try writer.writeByte('(');
            try writeWords(writer, entry.option.words);
            try writer.writeByte(')');
        },
        .words_or_file => {
            try writer.writeAll(" _raylane_words_or_files ");
            try writeWords(writer, entry.option.words);
        },
    }
    try writer.writeByte('\'');
}

fn writeFish(writer: *Writer, pages: []const Page) Writer.Error!void {
    try writer.writeAll("# fish completion of raylane; made by 'raylane completion fish'\n");
    for (pages) |*page| if (page.word.len > 0) {
        try writer.print(
            "complete -c raylane -n __fish_use_subcommand -a {s} -d '",
            .{page.word},
        );
        try writeFishText(writer, page.summary);
        try writer.writeAll("'\n");
    };
    for (pages) |*page| {
        if (page.words) |words| {
            try writeFishCondition(writer, page, pages);
            try writer.writeAll(" -f -a '");
            try writeWords(writer, words);
            try writer.writeAll("'\n");
        }
        var options = page.iterate();
        while (options.next()) |entry| {
            try writeFishCondition(writer, page, pages);
            if (entry.flag.short != 0) try writer.print(" -s {c}", .{entry.flag.short});
            try writer.print(" -l {s}", .{entry.flag.long[2..]});
            switch (entry.kind()) {
                .nothing => {},
                .anything, .words => try writer.writeAll(" -x"),
                .file, .words_or_file => try writer.writeAll(" -r -F"),
                .folder => try writer.writeAll(" -x -a '(__fish_complete_directories)'"),
            }
            if (entry.option.words.len > 0) {
                try writer.writeAll(" -a '");
                try writeWords(writer, entry.option.words);
                try writer.writeByte('\'');
            }
            try writer.writeAll(" -d '");
            try writeFishText(writer, entry.option.help);
            try writer.writeAll("'\n");
        }
    }
}

/// `complete` for a command; for the one without a word, where none of the others stands.
fn writeFishCondition(writer: *Writer, page: *const Page, pages: []const Page) Writer.Error!void {
    try writer.writeAll("complete -c raylane -n '");
    if (page.word.len > 0) {
        try writer.print("__fish_seen_subcommand_from {s}'", .{page.word});
        return;
    }
    try writer.writeAll("not __fish_seen_subcommand_from");
    for (pages) |*other| if (other.word.len > 0) try writer.print(" {s}", .{other.word});
    try writer.writeByte('\'');
}

fn writeFishText(writer: *Writer, text: []const u8) Writer.Error!void {
    return writeEscaped(writer, text, &.{ .{ "\\", "\\\\" }, .{ "'", "\\'" }, .{ "\n", " " } });
}

fn writeCommands(writer: *Writer, pages: []const Page) Writer.Error!void {
    var separator: []const u8 = "";
    for (pages) |*page| if (page.word.len > 0) {
        try writer.print("{s}{s}", .{ separator, page.word });
        separator = " ";
    };
}

fn writeWords(writer: *Writer, words: []const []const u8) Writer.Error!void {
    for (words, 0..) |word, index| {
        try writer.print("{s}{s}", .{ if (index > 0) " " else "", word });
    }
}

/// Writes a text with some of its characters replaced.
pub fn writeEscaped(
    writer: *Writer,
    text: []const u8,
    comptime replaced: []const [2][]const u8,
) Writer.Error!void {
    next: for (text) |byte| {
        inline for (replaced) |pair| {
            if (byte == pair[0][0]) {
                try writer.writeAll(pair[1]);
                continue :next;
            }
        }
        try writer.writeByte(byte);
    }
}
