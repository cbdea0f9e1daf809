//! What a file is, by its contents: signatures, sizes and first words.
//!
//! In: the bytes of a file, and its name for what its contents leave open. Out: the format to read
//! it as, or what else it is and what to do about it. Formats differ in how sure they can be told:
//! signatures come first, then a binary STL by its size (84 + 50 n bytes), then texts by their
//! first significant word, and the name last.

const std = @import("std");
const settings = @import("../settings.zig");
const Format = settings.SceneFormat;

/// What contents tell.
pub const Recognized = union(enum) {
    format: Format,
    /// A gzip file, whatever is in it.
    gzip,
    /// Something else, as what follows "is".
    foreign: []const u8,
    unknown,
};

/// What stands in the place of a file that Git LFS has not fetched.
const pointer_start = "version https://git-lfs.";
const pointer = "a Git LFS pointer, not the file itself; git lfs pull fetches that";

/// What stands where a file of any other kind should be; null: nothing of that sort.
pub fn misplaced(bytes: []const u8) ?[]const u8 {
    if (std.mem.startsWith(u8, bytes, pointer_start)) return pointer;
    const start = std.mem.trimStart(u8, bytes[0..@min(bytes.len, 64)], " \t\r\n");
    for (tags) |one| {
        const is_page = std.mem.eql(u8, one.is, web_page);
        if (is_page and std.ascii.startsWithIgnoreCase(start, one.tag)) return web_page;
    }
    return null;
}

const Signature = struct {
    bytes: []const u8,
    /// Where it stands.
    offset: usize = 0,
    is: Recognized,
};

const picture = "; a picture is no scene";
const convert = "; convert it to glTF";
const environment = " picture; --env lights a scene with it";
const tiles = "a 3D Tiles payload" ++ convert;
const unpack = "; unpack it and name a file in it";
const web_page = "a web page (HTML), perhaps what a failed download left";

/// Of binary files, longer ones before those that begin them.
const signatures = [_]Signature{
    .{ .bytes = "glTF", .is = .{ .format = .glb } },
    .{ .bytes = "\x1f\x8b", .is = .gzip },
    .{ .bytes = "\x89PNG\r\n\x1a\n", .is = .{ .foreign = "a PNG" ++ picture } },
    .{ .bytes = "\xff\xd8\xff", .is = .{ .foreign = "a JPEG" ++ picture } },
    .{ .bytes = "GIF8", .is = .{ .foreign = "a GIF" ++ picture } },
    .{ .bytes = "II*\x00", .is = .{ .foreign = "a TIFF" ++ picture } },
    .{ .bytes = "MM\x00*", .is = .{ .foreign = "a TIFF" ++ picture } },
    .{ .bytes = "8BPS", .is = .{ .foreign = "a Photoshop document" ++ picture } },
    .{ .bytes = "DDS ", .is = .{ .foreign = "a DDS texture" ++ picture } },
    .{ .bytes = "\xabKTX ", .is = .{ .foreign = "a KTX texture" ++ picture } },
    .{ .bytes = "WEBP", .offset = 8, .is = .{ .foreign = "a WebP" ++ picture } },
    .{ .bytes = "ftypavif", .offset = 4, .is = .{ .foreign = "an AVIF" ++ picture } },
    .{ .bytes = "v/1\x01", .is = .{ .foreign = "an OpenEXR" ++ environment } },
    .{ .bytes = "#?R", .is = .{ .foreign = "a Radiance" ++ environment } },
    .{ .bytes = "7z\xbc\xaf\x27\x1c", .is = .{ .foreign = "a 7z archive" ++ unpack } },
    .{ .bytes = "Rar!\x1a\x07", .is = .{ .foreign = "a RAR archive" ++ unpack } },
    .{ .bytes = "\xfd7zXZ\x00", .is = .{ .foreign = "an xz file" ++ unpack } },
    .{ .bytes = "\x28\xb5\x2f\xfd", .is = .{ .foreign = "a Zstandard file" ++ unpack } },
    .{ .bytes = "BZh", .is = .{ .foreign = "a bzip2 file" ++ unpack } },
    .{ .bytes = "ustar", .offset = 257, .is = .{ .foreign = "a tar archive" ++ unpack } },
    .{ .bytes = "Kaydara FBX Binary", .is = .{ .foreign = "an FBX file" ++ convert } },
    .{ .bytes = "; FBX ", .is = .{ .foreign = "an FBX file (text)" ++ convert } },
    .{ .bytes = "BLENDER", .is = .{ .foreign = "a Blender file; export it as glTF" } },
    .{ .bytes = "PXR-USDC", .is = .{ .foreign = "a USD crate" ++ convert } },
    .{ .bytes = "#usda", .is = .{ .foreign = "a USD text" ++ convert } },
    .{ .bytes = "Ogawa", .is = .{ .foreign = "an Alembic file" ++ convert } },
    .{ .bytes = "DRACO", .is = .{ .foreign = "a bare Draco mesh" ++ convert } },
    .{ .bytes = "3D Geometry File", .is = .{ .foreign = "a Rhino file" ++ convert } },
    .{ .bytes = "\xff\xfe\xff\x0eS\x00k", .is = .{ .foreign = "a SketchUp file" ++ convert } },
    .{ .bytes = "\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", .is = .{
        .foreign = "an OLE document, as 3ds Max writes them" ++ convert,
    } },
    .{ .bytes = "LWO", .offset = 8, .is = .{ .foreign = "a LightWave object" ++ convert } },
    .{ .bytes = "b3dm", .is = .{ .foreign = tiles } },
    .{ .bytes = "i3dm", .is = .{ .foreign = tiles } },
    .{ .bytes = "pnts", .is = .{ .foreign = tiles } },
    .{ .bytes = "cmpt", .is = .{ .foreign = tiles } },
    .{ .bytes = "xof 0", .is = .{ .foreign = "a DirectX file" ++ convert } },
    .{ .bytes = "AC10", .is = .{ .foreign = "a DWG drawing" ++ convert } },
    .{ .bytes = "ftyp", .offset = 4, .is = .{ .foreign = "a film or a picture, no scene" } },
    .{ .bytes = "#VRML", .is = .{ .foreign = "a VRML file" ++ convert } },
    .{ .bytes = "//Maya", .is = .{ .foreign = "a Maya scene" ++ convert } },
    .{ .bytes = "ISO-10303-21", .is = .{ .foreign = "a STEP file" ++ convert } },
    .{ .bytes = pointer_start, .is = .{ .foreign = pointer } },
    .{ .bytes = "%PDF", .is = .{ .foreign = "a PDF document, no scene" } },
    .{ .bytes = "\x7fELF", .is = .{ .foreign = "a program, no scene" } },
    .{ .bytes = "SQLite format 3", .is = .{ .foreign = "a database, no scene" } },
    .{ .bytes = "\xff\xfe", .is = .{ .foreign = "a text in UTF-16; save it as UTF-8" } },
    .{ .bytes = "\xfe\xff", .is = .{ .foreign = "a text in UTF-16; save it as UTF-8" } },
    .{ .bytes = "ply\n", .is = .{ .format = .ply } },
    .{ .bytes = "ply\r", .is = .{ .format = .ply } },
    .{ .bytes = "ply ", .is = .{ .format = .ply } },
};

/// Of texts that are marked up, in any case.
const tags = [_]struct { tag: []const u8, is: []const u8 }{
    .{ .tag = "<!doctype html", .is = web_page },
    .{ .tag = "<html", .is = web_page },
    .{ .tag = "<head", .is = web_page },
    .{ .tag = "<body", .is = web_page },
    .{ .tag = "<collada", .is = "a COLLADA file" ++ convert },
    .{ .tag = "<x3d", .is = "an X3D file" ++ convert },
    .{ .tag = "<svg", .is = "an SVG" ++ picture },
    .{ .tag = "<scene", .is = "a scene in XML, perhaps of Mitsuba" ++ convert },
};

/// Bytes in which the first words of a text are looked for.
const text_bytes_max = 1 << 16;

/// Header of a binary STL, the number of its triangles included, and bytes of each.
pub const stl_header_bytes = 84;
pub const stl_triangle_bytes = 50;

/// What `bytes`, of a file that is called `name`, are.
pub fn recognize(bytes: []const u8, name: []const u8) Recognized {
    if (bytes.len == 0) return .{ .foreign = "empty" };
    if (isArchive(bytes)) return .{ .foreign = archive(bytes) };
    if (isBinaryStl(bytes)) return .{ .format = .stl };
    if (is3ds(bytes)) return .{ .foreign = "a 3DS file" ++ convert };
    const text = bytes[markBytes(bytes)..];
    for (signatures) |signature| {
        const start = if (signature.offset == 0) text else bytes;
        if (start.len < signature.offset) continue;
        if (std.mem.startsWith(u8, start[signature.offset..], signature.bytes)) return signature.is;
    }
    if (ofText(text[0..@min(text.len, text_bytes_max)])) |found| return found;
    return if (ofName(name)) |format| .{ .format = format } else .unknown;
}

/// Whether the size is that of a binary STL with as many triangles as it says.
fn isBinaryStl(bytes: []const u8) bool {
    if (bytes.len < stl_header_bytes) return false;
    const count = std.mem.readInt(u32, bytes[stl_header_bytes - 4 ..][0..4], .little);
    return bytes.len - stl_header_bytes == @as(u64, count) * stl_triangle_bytes and count > 0;
}

/// A chunk of all that there is.
fn is3ds(bytes: []const u8) bool {
    return bytes.len >= 6 and std.mem.startsWith(u8, bytes, "MM") and
        std.mem.readInt(u32, bytes[2..6], .little) == bytes.len;
}

fn isArchive(bytes: []const u8) bool {
    for ([_][]const u8{ "PK\x03\x04", "PK\x05\x06" }) |signature| {
        if (std.mem.startsWith(u8, bytes, signature)) return true;
    }
    return false;
}

/// A zip archive by the name of its first file (APPNOTE.TXT, section 4.3.7).
fn archive(bytes: []const u8) []const u8 {
    const header_bytes = 30;
    var first: []const u8 = "";
    if (bytes.len >= header_bytes) {
        const length = std.mem.readInt(u16, bytes[26..28], .little);
        first = bytes[header_bytes..][0..@min(length, bytes.len - header_bytes)];
    }
    for ([_][]const u8{ ".usdc", ".usda", ".usd" }) |extension| {
        if (std.ascii.endsWithIgnoreCase(first, extension))
            return "a USDZ package" ++ convert;
    }
    const is_3mf = std.mem.startsWith(u8, first, "3D/") or
        (std.mem.eql(u8, first, "[Content_Types].xml") and
            std.mem.find(u8, bytes, "3D/3dmodel.model") != null);
    if (is_3mf) return "a 3MF package" ++ convert;
    return "a zip archive" ++ unpack;
}

/// Length of the byte order mark that editors of Windows put before a text (RFC 3629, section 6);
/// 0: there is none.
pub fn markBytes(text: []const u8) usize {
    const mark = "\xef\xbb\xbf";
    return if (std.mem.startsWith(u8, text, mark)) mark.len else 0;
}

/// What the beginning of a text says; null: nothing.
fn ofText(start: []const u8) ?Recognized {
    const text = std.mem.trimStart(u8, start, " \t\r\n");
    if (text.len == 0) return null;
    if (text[0] == '{') return .{ .format = .gltf };
    if (text[0] == '<') return .{ .foreign = ofMarkup(text) };
    if (isAsciiStl(text)) return .{ .format = .stl };
    if (std.mem.findScalar(u8, start, 0) != null) return null;
    var lines = std.mem.tokenizeAny(u8, text, "\r\n");
    while (lines.next()) |line| {
        const trimmed = std.mem.trimStart(u8, line, " \t");
        const end = std.mem.findAny(u8, trimmed, " \t#\"[") orelse trimmed.len;
        const word = trimmed[0..end];
        if (word.len == 0) continue;
        if (isOneOf(word, pbrt_words)) return .{ .format = .pbrt };
        if (isOneOf(word, obj_words)) {
            // A letter by itself may be anything; the default group is followed by more.
            if (end == trimmed.len) continue;
            return .{ .format = .obj };
        }
        if (std.mem.eql(u8, word, "0") and std.mem.eql(u8, lines.next() orelse "", "SECTION"))
            return .{ .foreign = "a DXF drawing" ++ convert };
        if (std.mem.eql(u8, word, "newmtl"))
            return .{ .foreign = "a material library of an OBJ file; name that file" };
        if (isOneOf(word, "OFF COFF NOFF"))
            return .{ .foreign = "an OFF file" ++ convert };
        return null;
    }
    return null;
}

fn isOneOf(word: []const u8, words: []const u8) bool {
    var others = std.mem.tokenizeAny(u8, words, " \n");
    while (others.next()) |other| if (std.mem.eql(u8, word, other)) return true;
    return false;
}

/// Words that begin an OBJ file or one of its lines.
const obj_words = "v vt vn vp f o g s p l mtllib usemtl mg";

/// Directives that a PBRT text may begin with.
const pbrt_words =
    \\Accelerator ActiveTransform AreaLightSource Attribute AttributeBegin Camera ColorSpace
    \\ConcatTransform CoordSysTransform CoordinateSystem Film Identity Import Include Integrator
    \\LightSource LookAt MakeNamedMaterial MakeNamedMedium Material MediumInterface
    \\NamedMaterial ObjectBegin ObjectInstance Option PixelFilter Renderer ReverseOrientation
    \\Rotate Sampler Scale Shape SurfaceIntegrator Texture Transform TransformBegin
    \\TransformTimes Translate Volume VolumeIntegrator WorldBegin
;

/// Whether the bytes are an STL text; binary ones may begin with "solid" as well.
pub fn isTextStl(bytes: []const u8) bool {
    return !isBinaryStl(bytes) and
        isAsciiStl(std.mem.trimStart(u8, bytes[markBytes(bytes)..], " \t\r\n"));
}

fn isAsciiStl(text: []const u8) bool {
    if (!std.ascii.startsWithIgnoreCase(text, "solid")) return false;
    const start = text[0..@min(text.len, text_bytes_max)];
    if (std.mem.findScalar(u8, start, 0) != null) return false;
    return std.ascii.findIgnoreCase(start, "facet") != null or
        std.ascii.findIgnoreCase(start, "endsolid") != null;
}

/// What a text that begins with `<` is.
fn ofMarkup(text: []const u8) []const u8 {
    for (tags) |one| {
        if (std.ascii.findIgnoreCase(text[0..@min(text.len, 1024)], one.tag) != null) return one.is;
    }
    return "an XML file, no scene that is read";
}

/// The format that a name's extension stands for.
fn ofName(name: []const u8) ?Format {
    const plain = if (std.ascii.endsWithIgnoreCase(name, ".gz")) name[0 .. name.len - 3] else name;
    const extension = std.fs.path.extension(plain);
    if (extension.len == 0) return null;
    for (std.enums.values(Format)) |format| {
        if (std.ascii.eqlIgnoreCase(extension[1..], @tagName(format))) return format;
    }
    return null;
}

const dots = "......................";
const zeros: [18]u8 = @splat(0);
const blanks: [75]u8 = @splat(' ');
const hundred: [100]u8 = @splat('.');

fn expectForeign(needle: []const u8, bytes: []const u8) !void {
    const found = recognize(bytes, "");
    errdefer std.debug.print("{s}: {any}\n", .{ needle, found });
    try std.testing.expect(std.mem.startsWith(u8, found.foreign, needle));
}

test "what is no scene is named" {
    try expectForeign("empty", "");
    try expectForeign("a PNG;", "\x89PNG\r\n\x1a\n....");
    try expectForeign("a WebP;", "RIFF\x00\x00\x00\x00WEBPVP8 ");
    try expectForeign("a USDZ package", "PK\x03\x04" ++ dots ++ "\x06\x00\x00\x00a.usdc");
    try expectForeign("a 3MF package", "PK\x03\x04" ++ dots ++ "\x03\x00\x00\x003D/_rels");
    try expectForeign("a zip archive", "PK\x03\x04");
    try expectForeign("a zip archive", "PK\x05\x06" ++ zeros);
    try expectForeign("a 3DS file", "MM\x0a\x00\x00\x00....");
    try expectForeign("an FBX file;", "Kaydara FBX Binary  \x00\x1a\x00");
    try expectForeign("a web page", "\xef\xbb\xbf\n <!DOCTYPE HTML>\n<title>404</title>");
    try expectForeign("a COLLADA", "<?xml version=\"1.0\"?>\n<COLLADA xmlns=\"\">");
    try expectForeign("an XML file", "<?xml version=\"1.0\"?><a/>");
    try expectForeign("a Git LFS pointer", "version https://git-lfs.github.com/spec/v1\noid");
    try expectForeign("a 3D Tiles payload;", "b3dm\x01\x00");
    try expectForeign("a DXF drawing;", "  0\r\nSECTION\r\n  2\r\nHEADER\r\n");
    try expectForeign("a text in UTF-16", "\xff\xfe{\x00");
    try expectForeign("a material library", "# by hand\n\nnewmtl a\nKd 1 0 0\n");
    try std.testing.expectEqualStrings(web_page, misplaced("\n<!DOCTYPE html><html>").?);
    try std.testing.expectEqual(null, misplaced("<htm"));
    try std.testing.expectEqual(.gzip, recognize("\x1f\x8b\x08", ""));
}

test "what is a scene is told by its contents, and by its name where these do not tell" {
    const two_triangles = "solid" ++ blanks ++ "\x02\x00\x00\x00" ++ hundred;
    for ([_]struct { Format, []const u8, []const u8 }{
        .{ .glb, "glTF\x02\x00\x00\x00", "a.obj" },
        .{ .gltf, "\xef\xbb\xbf \n{\"asset\":{}}", "a.txt" },
        .{ .gltf, "[", "a.gltf" },
        .{ .ply, "ply\r\nformat ascii 1.0", "" },
        .{ .stl, two_triangles, "a.obj" },
        .{ .stl, "solid a b\n facet normal 0 0 1", "" },
        .{ .stl, "SOLID\nendsolid", "" },
        .{ .stl, two_triangles[0..150], "a.STL" },
        .{ .obj, "# v\n\n  mtllib a.mtl\r\nv 0 0 0", "a.pbrt" },
        .{ .obj, "v\t0 0 0", "" },
        .{ .obj, "g\nv 0 0 0", "" },
        .{ .pbrt, "#!\n\tLookAt 0 0 5", "a" },
        .{ .pbrt, "WorldBegin", "" },
        .{ .pbrt, "Bang", "b.PBRT" },
        .{ .pbrt, "# nothing", "b.pbrt.gz" },
    }) |case| {
        errdefer std.debug.print("{s}\n", .{case[1]});
        try std.testing.expectEqual(case[0], recognize(case[1], case[2]).format);
    }
    for ([_][]const u8{ "hello", "\x00\x01", "solid state", "vertex 0 0 0", "#", "g" }) |bytes| {
        try std.testing.expectEqual(.unknown, recognize(bytes, "a.dat"));
    }
}
