//! `@import("raylane")` as the tests have it.
//!
//! All tests of a target are one module (tests.zig), for the library takes most of the time that
//! they take to compile. A file belongs to one module only: so this one hands on what that root
//! has of the library.

const raylane = @import("tests").raylane;

pub const batch = raylane.batch;
pub const bench = raylane.bench;
pub const builtin = raylane.builtin;
pub const cli = raylane.cli;
pub const compare = raylane.compare;
pub const decode = raylane.decode;
pub const denoise = raylane.denoise;
pub const diagnostic = raylane.diagnostic;
pub const energy = raylane.energy;
pub const film = raylane.film;
pub const huge_pages = raylane.huge_pages;
pub const identity = raylane.identity;
pub const image = raylane.image;
pub const licenses = raylane.licenses;
pub const info = raylane.info;
pub const math = raylane.math;
pub const memory_account = raylane.memory_account;
pub const merge = raylane.merge;
pub const output = raylane.output;
pub const parallel = raylane.parallel;
pub const parse = raylane.parse;
pub const prepare = raylane.prepare;
pub const report = raylane.report;
pub const scene = raylane.scene;
pub const session = raylane.session;
pub const settings = raylane.settings;
pub const simd = raylane.simd;
pub const statistics = raylane.statistics;
pub const trace = raylane.trace;
pub const variant = raylane.variant;
pub const world = raylane.world;
