// Written by delivery/web/make_numbers from constants of C++: numbers that compiler and clients go by.

/** Major version of packages that this library writes and reads (SPEC.md, Version history). */
export const formatMajor = 2;
/** Latest minor version that this library knows. */
export const formatMinor = 1;
/**
 * The manifest with its ZIP header fits in this many bytes, whatever the model: one request bootstraps a
 * client.
 */
export const bootstrapBytes = 16384;
/** What a client asks for in its first request. */
export const startBytes = 45056;
/** "Enough at any size": display_px of S_0 and the last step's up_to_px. */
export const anyDisplayPx = 1000000000;
/** Stands for "no vertex", "no triangle", "no fragment" ... wherever an index has 32 bits. */
export const noIndex = 4294967295;
/** Largest integer that every JSON reader keeps: 2^53. */
export const maxJsonInteger = 2 ** 53;
export const largestHalf = 31743; // 65504
/** Most texture planes of a package, mips included, and most rungs of a plane. */
export const maxPackagePlanes = 10000;
export const maxPackageRungs = 100;
/** Longest title in bytes of UTF-8; control characters are not allowed in it. */
export const maxTitleBytes = 200;
/** Most displayed heights at which proxies are measured, and the largest of them, px. */
export const maxProxySizes = 8;
export const maxProxySizePx = 65536;
/** Longest side that a proxy's textures may have. */
export const maxProxyTexturePx = 8192;
/** Longest side of a poster, px, and most bytes of its file. */
export const maxPosterSide = 4096;
/** Longest ManifestScale::floor, bytes. */
export const maxFloorBytes = 100;
export const largest = 1e+300; // of lengths: leaves room for sums
export const maxScales = 100; // two digits in the path
export const maxSide = 2 ** 20;
export const maxMip = 20;
export const maxTextBytes = 1000;
export const maxTexturesBytes = 2 ** 25;
export const maxFragments = 65535;
export const maxScaleCount = 100;
export const maxPlaneCells = 2 ** 24;
export const largestMse = 65025;
/** PlaneTables::allocation where VQP takes the place of eta. */
export const byVqp = 3;
export const maxQualityBytes = 2 ** 22;
export const maxQualitySizes = 8;
export const maxQualitySamples = 100;
export const maxAboutBytes = 262144;
/** Values of Gamma that tables hold sizes for: 0, 0.05 .. 1. */
export const gammaSteps = 21;
/** Most scales of a chain, S_0 among them. */
export const mostChainScales = 100;
export const mostTotalBytes = 2 ** 53;
/** The stream's own version, which may stay while that of packages moves. */
export const splitStreamMajor = 2;
export const mostSplits = 4096; // of a block
/** Faces or splits per byte of a block, at most: so few bytes never become much mesh. */
export const mostPerByte = 64;
export const splitSteps = 20;
export const splitBelow = 12;
export const splitValueLimit = 60; // a stream's models count as so many symbols seen
export const splitPrior = 24; // a stream's models count as so many symbols seen
export const splitLongest = 26;
export const splitModelLimit = 200;
export const splitDegrees = 14;
export const splitLefts = 12;
export const splitRuns = 7;
export const splitRings = 8;
export const splitValences = 5;
/** Daylight in viewers and posters: radiance that paper mirrors from right above and from right below. */
export const paperAbove = [
  0.955, 0.955, 0.955,
];
export const paperBelow = [
  0.653, 0.627, 0.577,
];
/**
 * Mirrors see a sky with more contrast: from this radiance so much brighter between two heights of the
 * direction, the lower one and what it is to the higher one.
 */
export const mirrorLow = 0.3;
export const mirrorRise = 1.4;
export const mirrorFrom = -0.6;
export const mirrorWidth = 1.5;
/** Where the lamp is that the camera carries, along its axes, and how bright. */
export const lampPlace = [
  -0.5, 0.7, 1,
];
export const lampIntensity = 2.2;
export const pi = 3.141592653589793;
export const ln2 = 0.6931471805599453;
export const ln2Hi = 0.6931471803691238;
export const ln2Lo = 1.9082149292705877e-10;
export const pio2Hi = 1.5707963267341256;
export const pio2Lo = 6.077100506506192e-11;
export const lossPerDoubling = 1.6;
export const lossPerHalving = 1.25;
export const leastFlip = 1e-06; // what logarithms take for 0
export const leastDssim = 1e-09; // 0 of texels is 0 of the picture
export const previewLevels = 3; // previews have 1/8 of the sides, large ones 1/16
export const flattest = 0.25; // of the lines that go on beyond the samples
export const steepest = 1; // of the lines that go on beyond the samples
export const behindOneSample = 0.5; // slope of the line that goes on behind a single one
export const proxyLossPerDoubling = 1.6;
/** Lit pictures with at most these losses cannot be told from S_0's (SPEC.md, 5.5). */
export const sameFlip = 0.05;
export const sameFlipP95 = 0.15;
export const moments = 64; // at which the time left is looked at
export const meshTimeShare = 0.5; // of the time left
export const paying = 0.95; // of the mean without a step
export const mostStepTime = 0.05; // of the time left: what comes later takes too much from the end
/** A coarser scale that is enough at any size stops just below, because the last step is always S_0's. */
export const belowAny = 999000000;
/** Keeps steps apart in the manifest's six digits. */
export const apart = 1.0001;
/** The thesis says no more of its units than that there are 20. */
export const firstDistancePx = 1024;
export const distanceStep = 1.2;
export const lumaQuantisers = [
  16, 11, 10, 16, 24, 40, 51, 61, 12, 12, 14, 19, 26, 58, 60, 55, 14, 13, 16, 24, 40, 57, 69, 56, 14, 17, 22,
  29, 51, 87, 80, 62, 18, 22, 37, 56, 68, 109, 103, 77, 24, 35, 55, 64, 81, 104, 113, 92, 49, 64, 78, 87, 103,
  121, 120, 101, 72, 92, 95, 98, 112, 100, 103, 99,
];
export const windowFactor = 1.5; // of throughput x round trip
export const tripSamples = 64; // a window that follows every swing makes them worse
export const windowSamples = 10;
export const guardSamples = 20;
export const breakFactor = 4; // a link this many times faster or slower is another link
export const leastSeconds = 1e-09;
export const gammaBisections = 20;
export const vertexBytes = 48;
export const triangleBytes = 12;
export const proxyTextures = 4;
export const meshShare = 0.5; // a mesh may take so much where a coarser one takes less
export const worthwhileFlip = 0.0001; // a coarser scale must look better, not only as good
export const farFromPlanned = 1.05;
export const fewerBytes = 0.7;
export const finerPays = 0.9;
export const finerLeaves = 0.5;
/** Square pixels that a triangle must have on average to show, of the square of the displayed height. */
export const leastTrianglePx2 = 0.5;
/** Quality of lists as printed, at most. */
export const highestPrinted = 97;
export const leastRequestS = 0.006; // a request is worth at least so much of the link
export const hiddenRtts = 0.6; // that six connections at once hide
export const leastDecisions = 48;
export const worthwhileFinerFlip = 0.002; // that finer planes must save: nobody sees less
export const worthwhilePart = 0.0625; // where little is lost: so much of it
export const reweightings = 2;
export const lossUnit = 2 ** 40; // 2^40: losses as spend_bytes counts them
export const leastWeight = 0.001; // of a group beside the others
export const doneBytes = 1e-06; // bytes: what rounding may leave of a transfer
export const forEver = 1000000000; // a time that nobody waits for
/**
 * How posters and viewers look at an object first: a camera of this vertical field of view looks at the
 * middle of the object's box, from this angle round the vertical axis and above the horizontal plane.
 */
export const firstLookFovDegrees = 32;
export const firstLookAzimuthDegrees = 28;
export const firstLookElevationDegrees = 18;
export const foveaRadiusDegrees = 0.5;
export const halfAcuityDegrees = 2.3;
