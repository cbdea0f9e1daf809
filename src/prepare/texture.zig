//! Textures: the images that drawn materials use become pyramids, by all threads.
//!
//! In: encoded images, textures and materials of a scene. Out: pyramids of 8-bit texels, and for
//! each material how it looks them up. An image is decoded once, keeps the channels that some
//! material uses, and is freed at once; one that is used both as light, by the sRGB curve, and as
//! numbers becomes two textures. Large images go first, and only as many at once as the memory for
//! it allows. What comes out depends neither on the order nor on the threads. An image that is
//! broken costs a warning, and whoever uses it does without.

const std = @import("std");
const decode = @import("../decode.zig");
const huge_pages = @import("../huge_pages.zig");
const math = @import("../math.zig");
const parallel = @import("../parallel.zig");
const pyramid_file = @import("pyramid.zig");
const relief = @import("relief.zig");
const scene = @import("../scene.zig");
const user_settings = @import("../settings.zig");
const world = @import("../world.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const printable = @import("../diagnostic.zig").printable;
const texture_use = @import("texture_use.zig");
const assert = std.debug.assert;
const channelsOf = texture_use.channelsOf;
const missing = texture_use.missing;
const viewOf = texture_use.viewOf;
const Allocator = std.mem.Allocator;
const Progress = @import("../progress.zig").Progress;
const Pyramid = pyramid_file.Pyramid;
const Texels = decode.Texels;
const Use = texture_use.Use;

/// How textures are made, and by whom.
pub const Settings = struct {
    pool: *parallel.Pool,
    /// Larger images are halved until they fit, at least 1.
    side_max: u32 = pyramid_file.side_max,
    /// Pixels of all images together, before that.
    pixel_count_max: u64 = user_settings.texture_pixel_count_max,
};

/// `SceneTooLarge`: the diagnostic says more.
pub const Error = error{ OutOfMemory, SceneTooLarge } || parallel.Error;

/// Bytes of all textures of a scene, at most.
const texture_bytes_max: u64 = 4 << 30;

/// Bytes of images that are decoded at the same time, what the libraries need included; one image
/// may be larger. Where all textures take more than twice as much, it is half of that.
const decode_bytes_max: u64 = 64 << 20;

/// The least and the largest that alpha is on a surface.
pub const AlphaRange = struct {
    least: f32 = 1,
    largest: f32 = 1,
};

/// How one material looks textures up.
pub const MaterialUse = struct {
    /// `TextureSet.lookups[first_lookup..][0..lookup_count]`, and those of slots of layers behind.
    first_lookup: u32 = 0,
    lookup_count: u32 = 0,
    layer_lookup_count: u32 = 0,
    /// See `texture_use.tangentSource`.
    tangents: ?texture_use.TangentSource = null,
    /// Of factor, texture and vertices together, wherever the material is drawn.
    alpha: AlphaRange = .{},
    /// Of the vertices alone; 1 where alpha does not count.
    vertex_alpha: AlphaRange = .{},
};

/// All textures of a scene, and who uses them.
pub const TextureSet = struct {
    arena: std.heap.ArenaAllocator,
    pyramids: []const Pyramid,
    textures: world.Textures,
    /// Of all materials, one after the other.
    lookups: []const world.Lookup,
    /// By material of the scene.
    materials: []const MaterialUse,
    byte_count: u64,

    /// Those of one material of the scene, for layers as well.
    pub fn lookupsOf(set: *const TextureSet, material: u32) []const world.Lookup {
        const use = &set.materials[material];
        return set.lookups[use.first_lookup..][0 .. use.lookup_count + use.layer_lookup_count];
    }

    /// Frees everything.
    pub fn deinit(set: *TextureSet) void {
        for (set.pyramids) |*pyramid| pyramid.deinit(set.arena.child_allocator);
        set.arena.deinit();
        set.* = undefined;
    }
};

/// An image, and what is wanted of it.
const Request = struct {
    image: u32,
    is_srgb: bool,
    /// Red, green, blue, alpha.
    wanted: [4]bool = @splat(false),
    /// Alpha below it is a hole, for some material: the first that says so.
    cutoff: ?f32 = null,
    /// What came of it; null: nothing.
    pyramid: ?Pyramid = null,
    /// The image has none of what is wanted, which counts as 1.
    is_blank: bool = false,
    /// Where each channel is stored, or `missing`.
    stored: [4]u8 = @splat(missing),
    channel_count: u8 = 0,
    alpha: AlphaRange = .{},
    /// Index of the texture.
    texture: u32 = 0,
};

/// One image to decode.
const Task = struct {
    image: u32,
    info: decode.Info,
    /// At most two requests: as light, as numbers. Indices, or `scene.none`.
    requests: [2]u32,

    /// Bytes while it is decoded: texels, and as much for the library.
    fn bytes(task: *const Task) u64 {
        const info = &task.info;
        const channel_bytes: u64 = if (info.is_float) 4 else 1;
        return 2 * channel_bytes * info.channel_count * info.width * info.height;
    }

    fn isLarger(_: void, a: Task, b: Task) bool {
        return if (a.bytes() == b.bytes()) a.image < b.image else a.bytes() > b.bytes();
    }
};

/// Decodes what the scene's drawn materials use; all memory is the result's and comes from `gpa`,
/// which threads share.
pub fn load(
    gpa: Allocator,
    from: *const scene.Scene,
    settings: Settings,
    diagnostic: *Diagnostic,
) Error!TextureSet {
    assert(settings.side_max >= 1);
    var work: Work = .{
        .gpa = gpa,
        .from = from,
        .side_max = settings.side_max,
        .pixel_count_max = settings.pixel_count_max,
    };
    defer work.deinit();
    errdefer work.dropPyramids();
    try work.collect();
    const byte_count = try work.plan(diagnostic);
    work.progress = settings.pool.progress;
    Progress.begin(work.progress, .{ .stage = .textures, .total = work.tasks.items.len });
    const at_once = @max(decode_bytes_max, byte_count / 2);
    var rest: []const Task = work.tasks.items;
    while (rest.len > 0) {
        const count = batchCount(rest, at_once);
        if (!try work.runBatch(settings.pool, rest[0..count])) {
            // There may be memory for one at a time.
            for (0..count) |index| {
                if (!try work.runBatch(settings.pool, rest[index..][0..1]))
                    return error.OutOfMemory;
            }
        }
        rest = rest[count..];
    }
    work.warn(diagnostic);
    return work.finish();
}

/// Bytes that the textures of a scene take at most, and how much that is while they are made.
pub const Plan = struct { byte_count: u64, peak_byte_count: u64 };

/// What `load` would ask for, by the headers of the images alone.
pub fn plan(
    gpa: Allocator,
    from: *const scene.Scene,
    side_max: u32,
    diagnostic: *Diagnostic,
) Error!Plan {
    var work: Work = .{ .gpa = gpa, .from = from, .side_max = side_max };
    defer work.deinit();
    try work.collect();
    const byte_count = try work.plan(diagnostic);
    const at_once = @max(decode_bytes_max, byte_count / 2);
    var peak: u64 = byte_count;
    var done: u64 = 0;
    var rest: []const Task = work.tasks.items;
    while (rest.len > 0) {
        const count = batchCount(rest, at_once);
        var decoding: u64 = 0;
        for (rest[0..count]) |*task| decoding += task.bytes();
        peak = @max(peak, done + decoding);
        for (rest[0..count]) |*task| done += work.pyramidBytes(&task.info, task.requests);
        rest = rest[count..];
    }
    return .{ .byte_count = byte_count, .peak_byte_count = peak };
}

/// How many of the tasks, in this order, are decoded at once: they need no more than `bytes_max`,
/// or it is one.
fn batchCount(tasks: []const Task, bytes_max: u64) usize {
    var total: u64 = 0;
    for (tasks, 0..) |*task, index| {
        total += task.bytes();
        if (total > bytes_max and index > 0) return index;
    }
    return tasks.len;
}

/// Shared by the threads.
const Work = struct {
    gpa: Allocator,
    from: *const scene.Scene,
    side_max: u32,
    pixel_count_max: u64 = user_settings.texture_pixel_count_max,
    is_drawn: []bool = &.{},
    vertex_alpha: []AlphaRange = &.{},
    requests: std.ArrayList(Request) = .empty,
    /// By image and use (light, numbers): index of the request or `scene.none`.
    request_of: [][2]u32 = &.{},
    tasks: std.ArrayList(Task) = .empty,
    /// By image: why there is none.
    reasons: []?decode.Reason = &.{},
    batch: []const Task = &.{},
    exhausted: std.atomic.Value(bool) = .init(false),
    progress: ?*Progress = null,

    fn deinit(work: *Work) void {
        work.gpa.free(work.is_drawn);
        work.gpa.free(work.vertex_alpha);
        work.requests.deinit(work.gpa);
        work.gpa.free(work.request_of);
        work.tasks.deinit(work.gpa);
        work.gpa.free(work.reasons);
    }

    fn dropPyramids(work: *Work) void {
        for (work.requests.items) |*request| {
            if (request.pyramid) |*pyramid| pyramid.deinit(work.gpa);
        }
    }

    /// Which materials are drawn, what of which images they want.
    fn collect(work: *Work) error{OutOfMemory}!void {
        const from = work.from;
        work.is_drawn = try work.gpa.alloc(bool, from.materials.len);
        @memset(work.is_drawn, false);
        work.vertex_alpha = try work.gpa.alloc(AlphaRange, from.materials.len);
        try work.lookAtMeshes();
        work.request_of = try work.gpa.alloc([2]u32, from.images.len);
        @memset(work.request_of, @splat(scene.none));
        work.reasons = try work.gpa.alloc(?decode.Reason, from.images.len);
        @memset(work.reasons, null);
        for (from.materials, work.is_drawn) |*material, is_drawn| {
            if (!is_drawn) continue;
            for (std.enums.values(Use)) |use| try work.want(material, use);
        }
    }

    /// Vertices may be shared by many instances, and are looked at once.
    fn lookAtMeshes(work: *Work) error{OutOfMemory}!void {
        const from = work.from;
        const is_mesh_drawn = try work.gpa.alloc(bool, from.meshes.len);
        defer work.gpa.free(is_mesh_drawn);
        @memset(is_mesh_drawn, false);
        for (from.instances) |instance| is_mesh_drawn[instance.mesh] = true;
        for (from.meshes, is_mesh_drawn) |*mesh, is_drawn| {
            if (!is_drawn or mesh.triangles.len == 0) continue;
            var range: AlphaRange = .{};
            const matters = from.materials[mesh.material].alpha_mode != .@"opaque";
            if (matters) if (mesh.colors) |colors| {
                range = .{ .least = std.math.inf(f32), .largest = 0 };
                for (colors) |color| range = join(range, exactly(color[3]));
                for (mesh.morph_targets) |target| {
                    if (target.colors != null) range = join(range, .{ .least = 0, .largest = 1 });
                }
            };
            const all = &work.vertex_alpha[mesh.material];
            all.* = if (work.is_drawn[mesh.material]) join(all.*, range) else range;
            work.is_drawn[mesh.material] = true;
        }
    }

    fn want(
        work: *Work,
        material: *const scene.Material,
        use: Use,
    ) error{OutOfMemory}!void {
        const view = viewOf(material, use) orelse return;
        const image = work.from.textures[view.texture].image;
        const is_srgb = use.isLight();
        const index = &work.request_of[image][@intFromBool(!is_srgb)];
        if (index.* == scene.none) {
            index.* = @intCast(work.requests.items.len);
            try work.requests.append(work.gpa, .{ .image = image, .is_srgb = is_srgb });
        }
        const request = &work.requests.items[index.*];
        for (channelsOf(material, use)) |channel| {
            if (channel != missing) request.wanted[channel] = true;
        }
        if (use == .base_color and material.alpha_mode == .mask and request.cutoff == null) {
            request.cutoff = material.alpha_cutoff / material.base_color[3];
        }
    }

    /// Reads the headers: what is broken is left out, what is too large refused. Returns the bytes
    /// that all textures take at most.
    fn plan(work: *Work, diagnostic: *Diagnostic) Error!u64 {
        var total: u64 = 0;
        var pixel_count = work.environmentPixels();
        for (work.request_of, 0..) |requests, image| {
            if (requests[0] == scene.none and requests[1] == scene.none) continue;
            var reason: decode.Reason = .{};
            var info = decode.info(work.from.images[image].bytes, &reason) catch {
                work.reasons[image] = reason;
                continue;
            };
            if (work.from.images[image].is_relief) info.channel_count = relief.channel_count;
            total += work.pyramidBytes(&info, requests);
            pixel_count += @as(u64, info.width) * info.height;
            try work.tasks.append(work.gpa, .{
                .image = @intCast(image),
                .info = info,
                .requests = requests,
            });
        }
        if (pixel_count > work.pixel_count_max) return diagnostic.fail(
            error.SceneTooLarge,
            "its images have {d} pixels, more than {d} (see --max-texture-pixels)",
            .{ pixel_count, work.pixel_count_max },
        );
        if (total > @min(texture_bytes_max, std.math.maxInt(usize))) return diagnostic.fail(
            error.SceneTooLarge,
            "its textures take {d} MiB, more than {d}; --max-texture-size makes them smaller",
            .{ total >> 20, texture_bytes_max >> 20 },
        );
        std.mem.sortUnstable(Task, work.tasks.items, {}, Task.isLarger);
        return total;
    }

    /// Pixels of the images that surround the scene.
    fn environmentPixels(work: *const Work) u64 {
        const map = if (work.from.environment) |*map| map else return 0;
        const faces: []const u32 = if (map.projection == .cube) &map.faces else &.{map.image};
        var count: u64 = 0;
        for (faces) |face| {
            var reason: decode.Reason = .{};
            const info = decode.info(work.from.images[face].bytes, &reason) catch continue;
            count += @as(u64, info.width) * info.height;
        }
        return count;
    }

    /// Bytes that an image's textures take at most.
    fn pyramidBytes(work: *const Work, info: *const decode.Info, requests: [2]u32) u64 {
        const size = pyramid_file.sizeWithin(info.width, info.height, work.side_max);
        var total: u64 = 0;
        for (requests) |index| {
            if (index == scene.none) continue;
            const request = &work.requests.items[index];
            const count = storedChannels(info.channel_count, request, true).count;
            total += pyramid_file.byteCount(size[0], size[1], count);
        }
        return total;
    }

    /// Whether there was memory for all of the tasks; what is done already is not done again.
    fn runBatch(
        work: *Work,
        pool: *parallel.Pool,
        batch: []const Task,
    ) parallel.Error!bool {
        work.batch = batch;
        work.exhausted.store(false, .monotonic);
        try pool.forEach(batch.len, work, run);
        return !work.exhausted.load(.monotonic);
    }

    fn run(work: *Work, index: usize, _: usize) void {
        const task = &work.batch[index];
        if (work.exhausted.load(.monotonic)) return;
        defer Progress.add(work.progress, 1);
        var reason: decode.Reason = .{};
        work.make(task, &reason) catch |err| switch (err) {
            error.InvalidImage => work.reasons[task.image] = reason,
            error.OutOfMemory => work.exhausted.store(true, .monotonic),
        };
    }

    fn make(work: *Work, task: *const Task, reason: *decode.Reason) decode.Error!void {
        if (work.isDone(task)) return;
        var texels: ?Texels =
            try decode.decode(work.gpa, work.from.images[task.image].bytes, reason);
        defer if (texels) |*left| left.deinit(work.gpa);
        if (work.from.images[task.image].is_relief) try relief.toNormals(work.gpa, &texels.?);
        const both = task.requests[0] != scene.none and task.requests[1] != scene.none;
        for (task.requests, 0..) |index, use| {
            if (index == scene.none) continue;
            const request = &work.requests.items[index];
            if (request.pyramid != null or request.is_blank) continue;
            // The last to come may take the texels over.
            const may_take = !both or use == 1;
            const image = try store(work.gpa, &texels, request, may_take) orelse {
                request.is_blank = true;
                continue;
            };
            request.pyramid = try pyramid_file.build(
                work.gpa,
                image,
                work.side_max,
                cutoffCode(request.cutoff),
            );
        }
    }

    fn isDone(work: *const Work, task: *const Task) bool {
        for (task.requests) |index| {
            if (index == scene.none) continue;
            const request = &work.requests.items[index];
            if (request.pyramid == null and !request.is_blank) return false;
        }
        return true;
    }

    /// In the order of the images.
    fn warn(work: *const Work, diagnostic: *Diagnostic) void {
        for (work.reasons, work.from.images) |*failure, *image| {
            if (failure.*) |*reason| diagnostic.forgiveEach("{f}: {s}, left out", .{
                printable(image.name), reason.text(),
            });
        }
    }

    fn finish(work: *Work) error{OutOfMemory}!TextureSet {
        var arena_state: std.heap.ArenaAllocator = .init(work.gpa);
        errdefer arena_state.deinit();
        const arena = arena_state.allocator();
        var pyramids: std.ArrayList(Pyramid) = try .initCapacity(arena, work.requests.items.len);
        for (work.requests.items) |*request| {
            if (request.pyramid == null) continue;
            request.texture = @intCast(pyramids.items.len);
            pyramids.appendAssumeCapacity(request.pyramid.?);
        }
        const textures = try arena.alloc(world.Texture, pyramids.items.len);
        var byte_count: u64 = 0;
        for (work.requests.items) |*request| if (request.pyramid != null) {
            const levels = pyramids.items[request.texture].levels();
            for (levels) |level| byte_count += level.texels.len;
            textures[request.texture] = .{
                .levels = levels,
                .channel_count = request.channel_count,
                .is_srgb = request.is_srgb,
            };
        };
        var lookups: std.ArrayList(world.Lookup) = .empty;
        const materials = try arena.alloc(MaterialUse, work.from.materials.len);
        for (materials, 0..) |*use, index| use.* = try work.useOf(arena, index, &lookups);
        return .{
            .arena = arena_state,
            .pyramids = pyramids.items,
            .textures = .{ .all = textures },
            .lookups = lookups.items,
            .materials = materials,
            .byte_count = byte_count,
        };
    }

    fn useOf(
        work: *const Work,
        arena: Allocator,
        index: usize,
        lookups: *std.ArrayList(world.Lookup),
    ) error{OutOfMemory}!MaterialUse {
        const first = lookups.items.len;
        var layer_count: u32 = 0;
        const material = &work.from.materials[index];
        if (!work.is_drawn[index]) return .{};
        var alpha = product(work.vertex_alpha[index], material.base_color[3]);
        for (std.enums.values(Use)) |use| {
            const view = viewOf(material, use) orelse continue;
            const texture = &work.from.textures[view.texture];
            const request_index = work.request_of[texture.image][@intFromBool(!use.isLight())];
            const request = &work.requests.items[request_index];
            if (request.pyramid == null) continue;
            const lookup = lookupOf(material, use, texture, request);
            // The image has nothing of what is wanted, which counts as 1.
            if (std.mem.allEqual(u8, &lookup.channels, missing)) continue;
            if (use == .alpha) alpha.least = 0; // Nobody has looked at the red.
            if (use == .base_color and lookup.channels[3] != missing) alpha = .{
                .least = alpha.least * request.alpha.least,
                .largest = alpha.largest * request.alpha.largest,
            };
            try lookups.append(arena, lookup);
            if (lookup.slot.isOfLayers()) layer_count += 1;
        }
        const moves_alpha = material.in_motion and material.alpha_mode != .@"opaque";
        if (moves_alpha) alpha = .{ .least = 0, .largest = 1 };
        const all = lookups.items[first..];
        return .{
            .first_lookup = @intCast(first),
            .lookup_count = @intCast(all.len - layer_count),
            .layer_lookup_count = layer_count,
            .tangents = texture_use.tangentSource(material, all),
            .alpha = alpha,
            .vertex_alpha = work.vertex_alpha[index],
        };
    }
};

fn exactly(alpha: f32) AlphaRange {
    return .{ .least = alpha, .largest = alpha };
}

fn join(a: AlphaRange, b: AlphaRange) AlphaRange {
    return .{
        .least = if (a.least < b.least) a.least else b.least,
        .largest = if (a.largest > b.largest) a.largest else b.largest,
    };
}

fn product(range: AlphaRange, factor: f32) AlphaRange {
    return .{ .least = range.least * factor, .largest = range.largest * factor };
}

fn lookupOf(
    material: *const scene.Material,
    use: Use,
    texture: *const scene.Texture,
    request: *const Request,
) world.Lookup {
    const view = viewOf(material, use).?;
    var channels = channelsOf(material, use);
    for (&channels) |*channel| {
        if (channel.* != missing) channel.* = request.stored[channel.*];
    }
    return .{
        .slot = use.slot(),
        .texture = request.texture,
        .wrap = .{ wrapOf(texture.wrap[0]), wrapOf(texture.wrap[1]) },
        .magnify_linear = texture.magnify == .linear,
        .minify_linear = texture.minify == .linear,
        .has_mips = texture.mip != .none,
        .mip_linear = texture.mip == .linear,
        .texcoord_set = @intCast(view.texcoord_set),
        .transform = view.transform,
        .channels = channels,
    };
}

fn wrapOf(wrap: scene.Wrap) world.Wrap {
    return switch (wrap) {
        .repeat => .repeat,
        .mirrored_repeat => .mirrored_repeat,
        .clamp_to_edge => .clamp_to_edge,
    };
}

/// The least code of alpha that is no hole; null where there are none, or nothing else.
fn cutoffCode(cutoff: ?f32) ?u8 {
    const least = (cutoff orelse return null) * 255;
    if (!(least > 0 and least <= 255)) return null;
    return @intFromFloat(@ceil(least));
}

/// What is stored of an image.
const Stored = struct {
    count: u8 = 0,
    /// Of the image, ascending but for gray that stands for three colours.
    sources: [4]u8 = undefined,
    /// Where each of red, green, blue and alpha is, or `missing`.
    at: [4]u8 = @splat(missing),
};

/// Gray is red, green and blue in one, but beside the alpha of light, whose place is the fourth.
fn storedChannels(channel_count: u8, request: *const Request, has_alpha: bool) Stored {
    var stored: Stored = .{};
    const is_gray = channel_count <= 2;
    const keeps_alpha = request.wanted[3] and has_alpha and channel_count % 2 == 0;
    const stretches = keeps_alpha and request.is_srgb;
    for (0..3) |channel| {
        if (!request.wanted[channel]) continue;
        if (is_gray and !stretches) {
            stored.at[channel] = 0;
            stored.sources[0] = 0;
            stored.count = 1;
        } else {
            stored.at[channel] = stored.count;
            stored.sources[stored.count] = if (is_gray) 0 else @intCast(channel);
            stored.count += 1;
        }
    }
    if (keeps_alpha) {
        assert(!request.is_srgb or stored.count == 3); // Base colours have alpha, and have all.
        stored.at[3] = stored.count;
        stored.sources[stored.count] = channel_count - 1;
        stored.count += 1;
    }
    return stored;
}

/// The channels of decoded texels that are wanted, as the finest level; null where there are none.
/// Takes the texels over where they are just that and the caller allows it.
fn store(
    gpa: Allocator,
    texels: *?Texels,
    request: *Request,
    may_take: bool,
) error{OutOfMemory}!?pyramid_file.Image {
    const from = &texels.*.?;
    const alpha = alphaRange(from);
    const stored = storedChannels(from.channel_count, request, alpha.least < 1);
    if (stored.count == 0) return null;
    request.stored = stored.at;
    request.channel_count = stored.count;
    if (stored.at[3] != missing) request.alpha = alpha;
    var image: pyramid_file.Image = .{
        .width = from.width,
        .height = from.height,
        .channel_count = stored.count,
        .encoding = if (!request.is_srgb) .linear else if (stored.at[3] == missing)
            .srgb
        else
            .srgb_alpha,
        .texels = undefined,
        .memory = undefined,
    };
    const bytes = @as(usize, from.width) * from.height * stored.count;
    // Texels of 16 bits leave a block that is twice as large.
    const is_whole = from.data == .bytes and stored.count == from.channel_count and
        from.memory.len < bytes + bytes / 4 + 4096;
    if (may_take and is_whole) {
        image.texels = from.data.bytes;
        image.memory = from.memory;
        texels.* = null;
        return image;
    }
    image.memory = try huge_pages.alloc(gpa, u8, bytes);
    image.texels = image.memory;
    switch (from.data) {
        .bytes => |all| pick(u8, from.channel_count, all, &stored, image.texels),
        .floats => |all| {
            pickFloats(from.channel_count, all, &stored, request.is_srgb, image.texels);
        },
    }
    return image;
}

/// Copies the stored channels of all texels.
fn pick(comptime T: type, channel_count: u8, from: []const T, stored: *const Stored, to: []T) void {
    switch (channel_count) {
        inline 1...4 => |in| switch (stored.count) {
            inline 1...4 => |out| {
                const sources = stored.sources;
                for (0..to.len / out) |texel| {
                    inline for (0..out) |channel| {
                        to[out * texel + channel] = from[in * texel + sources[channel]];
                    }
                }
            },
            else => unreachable,
        },
        else => unreachable,
    }
}

/// The same of linear floats, as the nearest codes.
fn pickFloats(
    channel_count: u8,
    from: []const f32,
    stored: *const Stored,
    is_srgb: bool,
    to: []u8,
) void {
    for (0..to.len / stored.count) |texel| {
        for (0..stored.count, stored.sources[0..stored.count]) |channel, source| {
            const value = from[channel_count * texel + source];
            const within = if (value < 1) value else 1;
            to[stored.count * texel + channel] = if (is_srgb and channel < 3)
                math.srgb.encode(within)
            else
                @intFromFloat(within * 255 + 0.5);
        }
    }
}

/// Of the texels' alpha; 1 without any.
fn alphaRange(texels: *const Texels) AlphaRange {
    if (texels.channel_count % 2 != 0) return .{};
    var range: AlphaRange = .{ .least = 1, .largest = 0 };
    var at: usize = texels.channel_count - 1;
    switch (texels.data) {
        .bytes => |all| {
            var least: u8 = 255;
            var largest: u8 = 0;
            while (at < all.len) : (at += texels.channel_count) {
                least = @min(least, all[at]);
                largest = @max(largest, all[at]);
            }
            range = .{
                .least = @as(f32, @floatFromInt(least)) / 255,
                .largest = @as(f32, @floatFromInt(largest)) / 255,
            };
        },
        .floats => |all| while (at < all.len) : (at += texels.channel_count) {
            const value = if (all[at] < 1) all[at] else 1;
            range = join(range, exactly(value));
        },
    }
    return range;
}

const testing = std.testing;

/// Images for tests.
pub const TestImage = struct {
    /// A PNG file of 8 bits a channel with texels stored as they are; it comes from `arena`.
    pub fn png(
        arena: Allocator,
        width: u32,
        height: u32,
        channel_count: u8,
        texels: []const u8,
    ) ![]const u8 {
        assert(texels.len == width * height * channel_count);
        var raw: std.ArrayList(u8) = .empty;
        for (0..height) |y| {
            try raw.append(arena, 0); // No filter.
            const stride = width * channel_count;
            try raw.appendSlice(arena, texels[y * stride ..][0..stride]);
        }
        var header: [13]u8 = undefined;
        std.mem.writeInt(u32, header[0..4], width, .big);
        std.mem.writeInt(u32, header[4..8], height, .big);
        const colours = [_]u8{ 0, 4, 2, 6 };
        header[8..13].* = .{ 8, colours[channel_count - 1], 0, 0, 0 };
        var body: std.ArrayList(u8) = .empty;
        try body.appendSlice(arena, &.{ 0x78, 0x01 });
        var rest: []const u8 = raw.items;
        while (true) {
            const length: u16 = @intCast(@min(rest.len, 0xffff));
            try body.append(arena, @intFromBool(length == rest.len));
            try appendInt(arena, &body, u16, length, .little);
            try appendInt(arena, &body, u16, ~length, .little);
            try body.appendSlice(arena, rest[0..length]);
            rest = rest[length..];
            if (rest.len == 0) break;
        }
        try appendInt(arena, &body, u32, std.hash.Adler32.hash(raw.items), .big);
        var file: std.ArrayList(u8) = .empty;
        try file.appendSlice(arena, "\x89PNG\r\n\x1a\n");
        try appendChunk(arena, &file, "IHDR", &header);
        try appendChunk(arena, &file, "IDAT", body.items);
        try appendChunk(arena, &file, "IEND", "");
        return file.items;
    }

    fn appendChunk(
        arena: Allocator,
        file: *std.ArrayList(u8),
        name: *const [4]u8,
        data: []const u8,
    ) !void {
        try appendInt(arena, file, u32, @intCast(data.len), .big);
        const start = file.items.len;
        try file.appendSlice(arena, name);
        try file.appendSlice(arena, data);
        try appendInt(arena, file, u32, std.hash.Crc32.hash(file.items[start..]), .big);
    }

    fn appendInt(
        arena: Allocator,
        bytes: *std.ArrayList(u8),
        comptime Int: type,
        value: Int,
        endian: std.lang.Endian,
    ) !void {
        var encoded: [@sizeOf(Int)]u8 = undefined;
        std.mem.writeInt(Int, &encoded, value, endian);
        try bytes.appendSlice(arena, &encoded);
    }
};

/// A scene of one triangle by material, every image in a texture of its own.
fn testScene(
    gpa: Allocator,
    files: []const []const u8,
    materials: []const scene.Material,
) !scene.Scene {
    var from: scene.Scene = .init(gpa);
    errdefer from.deinit();
    const arena = from.arena.allocator();
    const images = try arena.alloc(scene.Image, files.len);
    const textures = try arena.alloc(scene.Texture, files.len);
    for (images, textures, files, 0..) |*image, *texture, file, index| {
        image.* = .{
            .name = try arena.print("image {d}", .{index}),
            .bytes = try arena.dupe(u8, file),
        };
        texture.* = .{ .image = @intCast(index) };
    }
    const meshes = try arena.alloc(scene.Mesh, materials.len);
    const instances = try arena.alloc(scene.Instance, materials.len);
    for (meshes, instances, 0..) |*mesh, *instance, index| {
        mesh.* = .{
            .positions = &.{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } },
            .triangles = &.{.{ 0, 1, 2 }},
            .material = @intCast(index),
        };
        instance.* = .{ .mesh = @intCast(index), .node = 0 };
    }
    from.nodes = try arena.dupe(scene.Node, &.{.{ .parent = scene.none, .local = .identity }});
    from.materials = try arena.dupe(scene.Material, materials);
    from.images = images;
    from.textures = textures;
    from.meshes = meshes;
    from.instances = instances;
    from.check();
    return from;
}

fn testLoad(from: *const scene.Scene, side_max: u32, diagnostic: *Diagnostic) !TextureSet {
    var pool: parallel.Pool = .init(2);
    defer pool.deinit();
    return load(testing.allocator, from, .{ .pool = &pool, .side_max = side_max }, diagnostic);
}

test "channels that no material uses are not kept" {
    var files: std.heap.ArenaAllocator = .init(testing.allocator);
    defer files.deinit();
    const file = try TestImage.png(files.allocator(), 1, 1, 4, &.{ 10, 20, 30, 40 });
    const Case = struct { scene.Material, Use, []const u8, [4]u8 };
    const view: scene.TextureView = .{ .texture = 0 };
    for ([_]Case{
        .{ .{ .base_color_texture = view }, .base_color, &.{ 10, 20, 30 }, .{ 0, 1, 2, missing } },
        .{
            .{ .base_color_texture = view, .alpha_mode = .blend },
            .base_color,
            &.{ 10, 20, 30, 40 },
            .{ 0, 1, 2, 3 },
        },
        .{
            .{ .metallic_roughness_texture = view },
            .metallic_roughness,
            &.{ 20, 30 },
            .{ 0, 1, missing, missing },
        },
        .{
            .{ .alpha_texture = view, .alpha_mode = .mask },
            .alpha,
            &.{10},
            .{ missing, missing, missing, 0 },
        },
        .{ .{ .normal_texture = view }, .normal, &.{ 10, 20, 30 }, .{ 0, 1, 2, missing } },
        .{
            .{ .occlusion_texture = view },
            .occlusion,
            &.{10},
            .{ 0, missing, missing, missing },
        },
        .{
            .{ .emissive_texture = view, .emissive = .{ 1, 0, 0 } },
            .emissive,
            &.{ 10, 20, 30 },
            .{ 0, 1, 2, missing },
        },
    }) |case| {
        var from = try testScene(testing.allocator, &.{file}, &.{case[0]});
        defer from.deinit();
        var diagnostic: Diagnostic = .{};
        var set = try testLoad(&from, 1, &diagnostic);
        defer set.deinit();
        try testing.expectEqual(0, diagnostic.warning_count);
        try testing.expectEqual(1, set.lookups.len);
        try testing.expectEqual(case[1].slot(), set.lookups[0].slot);
        try testing.expectEqual(case[3], set.lookups[0].channels);
        try testing.expectEqual(MaterialUse{
            .lookup_count = 1,
            .tangents = if (case[1] == .normal) .{} else null,
            .alpha = switch (case[0].alpha_mode) {
                .blend => .{ .least = 40.0 / 255.0, .largest = 40.0 / 255.0 },
                .mask => .{ .least = 0 },
                .@"opaque" => .{},
            },
        }, set.materials[0]);
        const texture = &set.textures.all[0];
        try testing.expectEqualSlices(u8, case[2], texture.levels[0].texels);
        try testing.expectEqual(case[2].len, texture.channel_count);
        try testing.expectEqual(case[1].isLight(), texture.is_srgb);
        try testing.expectEqual(case[2].len, set.byte_count);
    }
}

/// A material whose layers all have a say, each use with the texture of its number.
fn layeredMaterial(view: scene.TextureView) scene.Material {
    var material: scene.Material = .{
        .metallic = 0,
        .roughness = 0.5,
        .emissive = .{ 1, 1, 1 },
        .transmission = 1,
        .volume = true,
        .attenuation_color = .{ 0.5, 0.5, 0.5 },
        .attenuation_distance = 1,
        .specular_color = .{ 2, 2, 2 },
        .clearcoat = 1,
        .clearcoat_roughness = 1,
        .sheen_color = .{ 1, 1, 1 },
        .sheen_roughness = 1,
        .iridescence = 1,
        .anisotropy = 1,
        .diffuse_transmission = 1,
        .multiscatter_color = .{ 0.5, 0.5, 0.5 },
    };
    inline for (scene.texture_fields) |field| @field(material, field) = view;
    return material;
}

test "layers' textures: which channels are kept, as light or as numbers" {
    var files: std.heap.ArenaAllocator = .init(testing.allocator);
    defer files.deinit();
    const file = try TestImage.png(files.allocator(), 1, 1, 4, &.{ 10, 20, 30, 40 });
    const colors = [_]u8{ 10, 20, 30 };
    const Case = struct { Use, []const u8 };
    const cases = [_]Case{
        .{ .transmission, &.{10} },          .{ .specular, &.{40} },
        .{ .specular_color, &colors },       .{ .glossiness, &.{40} },
        .{ .clearcoat, &.{10} },             .{ .clearcoat_roughness, &.{20} },
        .{ .clearcoat_normal, &colors },     .{ .sheen_color, &colors },
        .{ .sheen_roughness, &.{40} },       .{ .iridescence, &.{10} },
        .{ .iridescence_thickness, &.{20} }, .{ .anisotropy, &colors },
        .{ .diffuse_transmission, &.{40} },  .{ .diffuse_transmission_color, &colors },
        .{ .multiscatter_color, &colors },
    };
    try testing.expectEqual(world.Slot.count - world.Slot.base_count, cases.len);
    const uses = std.enums.values(Use);
    for (cases, uses[uses.len - cases.len ..]) |case, expected_use| {
        try testing.expectEqual(expected_use, case[0]);
        const all = layeredMaterial(.{ .texture = 0 });
        var material = all;
        inline for (scene.texture_fields) |field| @field(material, field) = null;
        switch (case[0]) {
            inline else => |use| {
                const field = @tagName(use) ++ "_texture";
                @field(material, field) = @field(all, field);
            },
        }
        var from = try testScene(testing.allocator, &.{file}, &.{material});
        defer from.deinit();
        var diagnostic: Diagnostic = .{};
        var set = try testLoad(&from, 1, &diagnostic);
        defer set.deinit();
        try testing.expectEqual(MaterialUse{
            .layer_lookup_count = 1,
            .tangents = .{}, // For the anisotropy.
        }, set.materials[0]);
        try testing.expectEqual(case[0].slot(), set.lookups[0].slot);
        const texture = &set.textures.all[0];
        try testing.expectEqualSlices(u8, case[1], texture.levels[0].texels);
        try testing.expectEqual(case[0].isLight(), texture.is_srgb);
        for (set.lookups[0].channels, 0..) |channel, index| {
            const wanted: u8 = if (index < case[1].len) @intCast(index) else missing;
            try testing.expectEqual(wanted, channel);
        }
    }
}

test "lookups of a material: base slots first, those of layers directly behind" {
    var files: std.heap.ArenaAllocator = .init(testing.allocator);
    defer files.deinit();
    const file = try TestImage.png(files.allocator(), 1, 1, 4, &.{ 10, 20, 30, 40 });
    const all = layeredMaterial(.{ .texture = 0, .texcoord_set = 3 });
    var unlit = all;
    unlit.unlit = true;
    var plain: scene.Material = .{};
    inline for (scene.texture_fields) |field| @field(plain, field) = @field(all, field);
    var from = try testScene(testing.allocator, &.{file}, &.{ all, unlit, plain });
    defer from.deinit();
    var diagnostic: Diagnostic = .{};
    var set = try testLoad(&from, 1, &diagnostic);
    defer set.deinit();
    const use = set.materials[0];
    try testing.expectEqual(world.Slot.base_count, use.lookup_count);
    try testing.expectEqual(world.Slot.count - world.Slot.base_count, use.layer_lookup_count);
    for (set.lookupsOf(0), 0..) |lookup, index| {
        try testing.expectEqual(index, @backingInt(lookup.slot));
        try testing.expectEqual(index >= use.lookup_count, lookup.slot.isOfLayers());
    }
    try testing.expectEqual(3, use.tangents.?.texcoord_set);
    // One texture of light and one of numbers, which has all channels for all who want some.
    try testing.expectEqual(2, set.textures.all.len);
    try testing.expectEqual(1, set.lookupsOf(1).len);
    try testing.expectEqual(.base_color, set.lookupsOf(1)[0].slot);
    // Without factors only those of the base are left; emissive is not, for it is 0.
    try testing.expectEqual(world.Slot.base_count - 1, set.materials[2].lookup_count);
    const kept = set.lookupsOf(2)[set.materials[2].lookup_count..];
    try testing.expectEqual(2, kept.len);
    for (kept, [_]world.Slot{ .specular, .specular_color }) |lookup, slot| {
        try testing.expectEqual(slot, lookup.slot);
    }
}

test "alpha as a number: alone, beside gray, and where there is none" {
    var files: std.heap.ArenaAllocator = .init(testing.allocator);
    defer files.deinit();
    const view: scene.TextureView = .{ .texture = 0 };
    const Case = struct { u8, []const u8, []const u8, ?u8 };
    for ([_]Case{
        .{ 2, &.{ 50, 60 }, &.{ 50, 60 }, 1 },
        .{ 4, &.{ 10, 20, 30, 60 }, &.{ 20, 30, 60 }, 2 },
        .{ 4, &.{ 10, 20, 30, 255 }, &.{ 20, 30 }, null },
        .{ 3, &.{ 10, 20, 30 }, &.{ 20, 30 }, null },
    }) |case| {
        const file = try TestImage.png(files.allocator(), 1, 1, case[0], case[1]);
        var from = try testScene(testing.allocator, &.{ file, file }, &.{
            .{ .metallic_roughness_texture = view, .specular_texture = view },
            .{ .metallic = 0, .specular = 0.5, .specular_texture = .{ .texture = 1 } },
        });
        defer from.deinit();
        var diagnostic: Diagnostic = .{};
        var set = try testLoad(&from, 1, &diagnostic);
        defer set.deinit();
        try testing.expectEqual(0, diagnostic.warning_count);
        const lookups = set.lookupsOf(0);
        const texels = set.textures.all[lookups[0].texture].levels[0].texels;
        try testing.expectEqualSlices(u8, case[2], texels);
        // An image that has nothing of what is wanted is no texture.
        const alpha_count: usize = if (case[3] == null) 0 else 1;
        if (case[3]) |channel| try testing.expectEqual(channel, lookups[1].channels[0]);
        try testing.expectEqual(1 + alpha_count, lookups.len);
        try testing.expectEqual(alpha_count, set.lookupsOf(1).len);
        try testing.expectEqual(1 + alpha_count, set.textures.all.len);
    }
}

test "uses of an image share a texture, but light and numbers do not" {
    var files: std.heap.ArenaAllocator = .init(testing.allocator);
    defer files.deinit();
    const file = try TestImage.png(files.allocator(), 1, 1, 3, &.{ 10, 20, 30 });
    const unused = try TestImage.png(files.allocator(), 1, 1, 3, &.{ 1, 2, 3 });
    const view: scene.TextureView = .{ .texture = 0, .texcoord_set = 2 };
    var from = try testScene(testing.allocator, &.{ file, unused }, &.{
        .{ .metallic_roughness_texture = view, .occlusion_texture = view },
        .{ .base_color_texture = view, .unlit = true, .normal_texture = view },
        .{ .base_color_texture = .{ .texture = 1 } },
    });
    defer from.deinit();
    from.instances = from.instances[0..2]; // The third is not drawn.
    var diagnostic: Diagnostic = .{};
    var set = try testLoad(&from, 64, &diagnostic);
    defer set.deinit();
    try testing.expectEqual(2, set.textures.all.len);
    try testing.expectEqual(3, set.lookups.len);
    const numbers = &set.textures.all[set.lookups[0].texture];
    try testing.expectEqual(set.lookups[0].texture, set.lookups[1].texture);
    try testing.expectEqualSlices(u8, &.{ 10, 20, 30 }, numbers.levels[0].texels);
    try testing.expectEqual([4]u8{ 1, 2, missing, missing }, set.lookups[0].channels);
    try testing.expectEqual([4]u8{ 0, missing, missing, missing }, set.lookups[1].channels);
    try testing.expectEqual(2, set.lookups[1].texcoord_set);
    try testing.expect(set.textures.all[set.lookups[2].texture].is_srgb);
    try testing.expectEqual(0, set.materials[2].lookup_count);
}

test "gray images are kept as gray, beside alpha as colours" {
    var files: std.heap.ArenaAllocator = .init(testing.allocator);
    defer files.deinit();
    const arena = files.allocator();
    const Case = struct { u8, []const u8, scene.AlphaMode, []const u8, [4]u8 };
    for ([_]Case{
        .{ 1, &.{50}, .blend, &.{50}, .{ 0, 0, 0, missing } },
        .{ 2, &.{ 50, 60 }, .@"opaque", &.{50}, .{ 0, 0, 0, missing } },
        .{ 2, &.{ 50, 60 }, .mask, &.{ 50, 50, 50, 60 }, .{ 0, 1, 2, 3 } },
        .{ 2, &.{ 50, 255 }, .mask, &.{50}, .{ 0, 0, 0, missing } },
        .{ 4, &.{ 50, 60, 70, 255 }, .mask, &.{ 50, 60, 70 }, .{ 0, 1, 2, missing } },
    }) |case| {
        const file = try TestImage.png(arena, 1, 1, case[0], case[1]);
        var from = try testScene(testing.allocator, &.{file}, &.{.{
            .base_color_texture = .{ .texture = 0 },
            .alpha_mode = case[2],
        }});
        defer from.deinit();
        var diagnostic: Diagnostic = .{};
        var set = try testLoad(&from, 1, &diagnostic);
        defer set.deinit();
        try testing.expectEqualSlices(u8, case[3], set.textures.all[0].levels[0].texels);
        try testing.expectEqual(case[4], set.lookups[0].channels);
    }
}

test "a broken image costs a warning, the others are there" {
    var files: std.heap.ArenaAllocator = .init(testing.allocator);
    defer files.deinit();
    const good = try TestImage.png(files.allocator(), 3, 5, 3, &@as([45]u8, @splat(9)));
    const cut = good[0 .. good.len - 30];
    const view: scene.TextureView = .{ .texture = 2 };
    var from = try testScene(testing.allocator, &.{ cut, "GIF89a", good }, &.{.{
        .base_color_texture = .{ .texture = 0 },
        .normal_texture = .{ .texture = 1 },
        .occlusion_texture = view,
    }});
    defer from.deinit();
    var diagnostic: Diagnostic = .{};
    var set = try testLoad(&from, 4, &diagnostic);
    defer set.deinit();
    try testing.expectEqual(2, diagnostic.warning_count);
    for (diagnostic.warnings[0..2], 0..) |*warning, index| {
        var start: [32]u8 = undefined;
        const expected = try std.fmt.bufPrint(&start, "image {d}: ", .{index});
        try testing.expect(std.mem.startsWith(u8, warning.text(), expected));
        try testing.expectStringEndsWith(warning.text(), ", left out");
        try testing.expect(warning.text().len > expected.len + ", left out".len);
    }
    try testing.expectEqual(1, set.lookups.len);
    try testing.expectEqual(.occlusion, set.lookups[0].slot);
    // Halved until no side is longer than 4: 1x2 and 1x1 are left.
    const levels = set.textures.all[0].levels;
    try testing.expectEqual(2, levels.len);
    try testing.expectEqual([2]u32{ 1, 2 }, .{ levels[0].width, levels[0].height });
    try testing.expectEqualSlices(u8, &.{ 9, 9 }, levels[0].texels);
}

test "alpha of factor, texture and vertices together" {
    var files: std.heap.ArenaAllocator = .init(testing.allocator);
    defer files.deinit();
    const texels = [_]u8{ 1, 2, 3, 51, 1, 2, 3, 204 };
    const file = try TestImage.png(files.allocator(), 2, 1, 4, &texels);
    var from = try testScene(testing.allocator, &.{file}, &.{ .{
        .base_color_texture = .{ .texture = 0 },
        .base_color = .{ 1, 1, 1, 0.5 },
        .alpha_mode = .mask,
    }, .{} });
    defer from.deinit();
    const meshes = try from.arena.allocator().dupe(scene.Mesh, from.meshes);
    meshes[0].colors = &.{ .{ 1, 1, 1, 0.25 }, .{ 1, 1, 1, 1 }, .{ 1, 1, 1, 0.5 } };
    from.meshes = meshes;
    var diagnostic: Diagnostic = .{};
    var set = try testLoad(&from, 64, &diagnostic);
    defer set.deinit();
    const alpha = set.materials[0].alpha;
    try testing.expectApproxEqRel(@as(f32, 0.25 * 0.5 * 0.2), alpha.least, 1e-6);
    try testing.expectApproxEqRel(@as(f32, 0.5 * 0.8), alpha.largest, 1e-6);
    try testing.expectEqual(AlphaRange{}, set.materials[1].alpha);
    try testing.expectEqual(128, cutoffCode(0.5));
    try testing.expectEqual(1, cutoffCode(1e-9));
    try testing.expectEqual(255, cutoffCode(1));
    for ([_]?f32{ null, 0, -1, 1.01, std.math.inf(f32), std.math.nan(f32) }) |none_kept| {
        try testing.expectEqual(null, cutoffCode(none_kept));
    }
}

test "images of more pixels than are allowed are refused by their headers" {
    var files: std.heap.ArenaAllocator = .init(testing.allocator);
    defer files.deinit();
    const file = try TestImage.png(files.allocator(), 2, 3, 1, &@as([6]u8, @splat(9)));
    var from = try testScene(testing.allocator, &.{ file, file }, &.{
        .{ .base_color_texture = .{ .texture = 0 } },
        .{ .base_color_texture = .{ .texture = 1 } },
    });
    defer from.deinit();
    var pool: parallel.Pool = .init(1);
    defer pool.deinit();
    var diagnostic: Diagnostic = .{};
    var settings: Settings = .{ .pool = &pool, .side_max = 1, .pixel_count_max = 11 };
    const refused = load(testing.allocator, &from, settings, &diagnostic);
    try testing.expectError(error.SceneTooLarge, refused);
    try testing.expectEqualStrings(
        "its images have 12 pixels, more than 11 (see --max-texture-pixels)",
        diagnostic.message.text(),
    );
    settings.pixel_count_max = 12;
    var set = try load(testing.allocator, &from, settings, &diagnostic);
    set.deinit();
}

test "threads change nothing, batches neither" {
    var files: std.heap.ArenaAllocator = .init(testing.allocator);
    defer files.deinit();
    const arena = files.allocator();
    var random_state: std.Random.DefaultPrng = .init(29);
    var list: [7][]const u8 = undefined;
    var materials: [7]scene.Material = undefined;
    for (&list, &materials, 0..) |*file, *material, index| {
        const side: u32 = @intCast(5 + 11 * index);
        const texels = try arena.alloc(u8, side * side * 4);
        random_state.random().bytes(texels);
        file.* = try TestImage.png(arena, side, side, 4, texels);
        const view: scene.TextureView = .{ .texture = @intCast(index) };
        material.* = .{
            .base_color_texture = view,
            .alpha_mode = .mask,
            .metallic_roughness_texture = view,
        };
    }
    var from = try testScene(testing.allocator, &list, &materials);
    defer from.deinit();
    var diagnostic: Diagnostic = .{};
    var sets: [2]TextureSet = undefined;
    for (&sets, [_]usize{ 1, 4 }) |*set, thread_count| {
        var pool: parallel.Pool = .init(thread_count);
        defer pool.deinit();
        set.* = try load(testing.allocator, &from, .{ .pool = &pool }, &diagnostic);
    }
    defer for (&sets) |*set| set.deinit();
    try testing.expectEqual(14, sets[0].textures.all.len);
    for (sets[0].textures.all, sets[1].textures.all) |a, b| {
        try testing.expectEqual(a.levels.len, b.levels.len);
        for (a.levels, b.levels) |x, y| try testing.expectEqualSlices(u8, x.texels, y.texels);
    }
    const large: Task = .{
        .image = 0,
        .info = .{
            .format = .png,
            .width = 4096,
            .height = 4096,
            .channel_count = 1,
            .is_float = false,
        },
        .requests = @splat(scene.none),
    };
    try testing.expectEqual(2, batchCount(&.{ large, large, large }, decode_bytes_max));
    var huge = large;
    huge.info.is_float = true;
    try testing.expectEqual(1, batchCount(&.{ huge, large }, decode_bytes_max));
}

test "floats become the nearest codes" {
    const wanted: [4]bool = .{ true, true, true, false };
    const request: Request = .{ .image = 0, .is_srgb = true, .wanted = wanted };
    const stored = storedChannels(3, &request, false);
    var codes: [3]u8 = undefined;
    pickFloats(3, &.{ 0.5, 2, 0 }, &stored, true, &codes);
    try testing.expectEqual([3]u8{ 188, 255, 0 }, codes);
    pickFloats(3, &.{ 0.5, 2, 0 }, &stored, false, &codes);
    try testing.expectEqual([3]u8{ 128, 255, 0 }, codes);
}

/// Refuses one request and no other.
const RefusesOne = struct {
    countdown: usize,
    has_refused: bool = false,

    fn allocator(refuses: *RefusesOne) Allocator {
        return .{ .ptr = refuses, .vtable = &.{
            .alloc = alloc,
            .resize = Allocator.noResize,
            .remap = Allocator.noRemap,
            .free = free,
        } };
    }

    fn alloc(context: *anyopaque, len: usize, alignment: std.mem.Alignment, at: usize) ?[*]u8 {
        const refuses: *RefusesOne = @ptrCast(@alignCast(context));
        refuses.countdown -|= 1;
        if (refuses.countdown > 0 or refuses.has_refused)
            return testing.allocator.rawAlloc(len, alignment, at);
        refuses.has_refused = true;
        return null;
    }

    fn free(_: *anyopaque, memory: []u8, alignment: std.mem.Alignment, at: usize) void {
        testing.allocator.rawFree(memory, alignment, at);
    }
};

test "where memory is too short for several images, one comes after the other" {
    var files: std.heap.ArenaAllocator = .init(testing.allocator);
    defer files.deinit();
    const file = try TestImage.png(files.allocator(), 2, 2, 4, &@as([16]u8, @splat(77)));
    const other = try TestImage.png(files.allocator(), 1, 2, 3, &@as([6]u8, @splat(88)));
    var from = try testScene(testing.allocator, &.{ file, other }, &.{.{
        .base_color_texture = .{ .texture = 0 },
        .alpha_mode = .blend,
        .occlusion_texture = .{ .texture = 0 },
        .normal_texture = .{ .texture = 1 },
    }});
    defer from.deinit();
    var pool: parallel.Pool = .init(1);
    defer pool.deinit();
    var done_count: usize = 0;
    for (1..100) |refused| {
        var refuses: RefusesOne = .{ .countdown = refused };
        var diagnostic: Diagnostic = .{};
        var set = load(refuses.allocator(), &from, .{ .pool = &pool }, &diagnostic) catch |err| {
            try testing.expectEqual(error.OutOfMemory, err); // Before or after the decoding.
            continue;
        };
        defer set.deinit();
        if (refuses.has_refused) done_count += 1;
        try testing.expectEqual(3, set.lookups.len);
        for (set.lookups, [_]u8{ 77, 88, 77 }) |lookup, texel| {
            for (set.textures.all[lookup.texture].levels) |level| {
                for (level.texels) |found| try testing.expectEqual(texel, found);
            }
        }
    }
    // One refused while images were decoded did no harm: texels, what is kept of them, the levels.
    try testing.expect(done_count >= 6);
}

test "texels are the same on every machine" {
    var files: std.heap.ArenaAllocator = .init(testing.allocator);
    defer files.deinit();
    var random_state: std.Random.DefaultPrng = .init(41);
    var texels: [61 * 38 * 4]u8 = undefined;
    random_state.random().bytes(&texels);
    const file = try TestImage.png(files.allocator(), 61, 38, 4, &texels);
    const view: scene.TextureView = .{ .texture = 0 };
    var hash: std.hash.XxHash64 = .init(0);
    for ([_]scene.AlphaMode{ .@"opaque", .mask }) |mode| {
        var from = try testScene(testing.allocator, &.{file}, &.{.{
            .base_color_texture = view,
            .alpha_mode = mode,
            .normal_texture = view,
        }});
        defer from.deinit();
        var diagnostic: Diagnostic = .{};
        var set = try testLoad(&from, 32, &diagnostic);
        defer set.deinit();
        for (set.textures.all) |texture| for (texture.levels) |level| hash.update(level.texels);
    }
    try testing.expectEqual(9264281432180316260, hash.final());
}

test "memory that runs out leaks nothing" {
    var files: std.heap.ArenaAllocator = .init(testing.allocator);
    defer files.deinit();
    const arena = files.allocator();
    const file = try TestImage.png(arena, 9, 6, 4, &@as([216]u8, @splat(100)));
    const view: scene.TextureView = .{ .texture = 0 };
    var from = try testScene(testing.allocator, &.{file}, &.{.{
        .base_color_texture = view,
        .alpha_mode = .mask,
        .normal_texture = view,
    }});
    defer from.deinit();
    const one = struct {
        fn one(failing: Allocator, scene_from: *const scene.Scene) !void {
            var pool: parallel.Pool = .init(1);
            defer pool.deinit();
            var diagnostic: Diagnostic = .{};
            const settings: Settings = .{ .pool = &pool, .side_max = 8 };
            var set = try load(failing, scene_from, settings, &diagnostic);
            set.deinit();
        }
    }.one;
    try testing.checkAllAllocationFailures(testing.allocator, one, .{&from});
}
