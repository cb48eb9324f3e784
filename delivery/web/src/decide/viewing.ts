import { anyDisplayPx } from '../format/layout';
import type { Manifest, ManifestScale, ManifestStep } from '../format/manifest';
import { apart, belowAny, distanceStep, firstDistancePx, leastTrianglePx2 } from '../format/shared_numbers';
import { cos, pi, sin } from './portable_math';

// From how an object is looked at to the scale that is enough: format/rules/viewing.h. Lengths on screen are
// device px; "displayed height" is the length on screen of the object's largest extent.

/** A perspective camera: vertical field of view, and the picture's height in device px. */
export interface CameraView {
  fovDegrees: number;
  viewportPx: number;
}

const halfTangent = (degrees: number): number => {
  const half = degrees * (pi / 360);
  return sin(half) / cos(half);
};

/** Displayed height of the object at a viewing distance (camera to object, > 0). */
export function displayedHeightPx(objectHeight: number, distance: number, camera: CameraView): number {
  return (objectHeight / (2 * distance * halfTangent(camera.fovDegrees))) * camera.viewportPx;
}

/**
 * The rule that decides about the scale: flip (default) = lit pictures that cannot be told from those of S_0,
 * which is what Manifest.steps holds; jnd = the just-noticeable difference; error = an error of one pixel;
 * edge = the O_V / E_S that matches the displayed height best; distance = the major scale of each distance
 * (7.5).
 */
export type StepRule = 'flip' | 'jnd' | 'error' | 'edge' | 'distance';

function edgeLimit(scales: readonly ManifestScale[], k: number): number {
  if (k > 1) return Math.sqrt(scales[k].displayPxEdge * scales[k - 1].displayPxEdge);
  // S_0's is not in the manifest: edges per length grow with the root of the number of triangles.
  const ratio = Math.sqrt(scales[0].triangles / Math.max(scales[1].triangles, 1));
  return scales[1].displayPxEdge * Math.sqrt(Math.max(ratio, 1));
}

function limitOf(scales: readonly ManifestScale[], k: number, rule: StepRule): number {
  if (rule === 'edge') return edgeLimit(scales, k);
  if (rule === 'distance') {
    let px = scales[k].major ? firstDistancePx : 0;
    for (let i = scales.slice(1, k).filter((s) => s.major).at(-1)?.scale ?? 0; i > 0; --i) px /= distanceStep;
    return px;
  }
  const { displayPxJnd, displayPxError, displayPxFlip } = scales[k];
  return rule === 'jnd' ? displayPxJnd : rule === 'error' ? displayPxError : displayPxFlip;
}

/** The step function displayed height -> scale by one rule, coarse to fine; the last step is S_0's. */
export function stepFunction(scales: readonly ManifestScale[], rule: StepRule): ManifestStep[] {
  const steps: ManifestStep[] = [];
  let reached = 0;
  for (let k = scales.length - 1; k >= 0; --k) {
    const limit = k === 0 ? anyDisplayPx : Math.min(limitOf(scales, k, rule), belowAny);
    if (limit <= reached * apart) continue;
    steps.push({ upToPx: limit, scale: scales[k].scale });
    reached = limit;
  }
  return steps;
}

/** The scale of the first step that reaches this height. */
export function scaleAt(steps: readonly ManifestStep[], displayedPx: number): number {
  for (const step of steps) if (displayedPx <= step.upToPx) return step.scale;
  return steps.length === 0 ? 0 : steps[steps.length - 1].scale;
}

/** The finest scale whose triangles show at a displayed height, whatever the step function calls enough. */
export function finestShown(scales: readonly ManifestScale[], displayedPx: number): number {
  const shown = scales.find((s) => s.triangles * leastTrianglePx2 <= displayedPx * displayedPx);
  return (shown ?? scales[scales.length - 1])?.scale ?? 0;
}

/** The shape that the visible part of an object makes (thesis 7.2, Fig. 7.5). */
export interface VisiblePart {
  /** Both 0: nothing of the object is to be seen. */
  widthPx: number;
  heightPx: number;
  /** false: the whole object is visible. */
  clipped: boolean;
}
/** The visible part of an object of which nothing is cut off. */
export const wholeObject: VisiblePart = { widthPx: 0, heightPx: 0, clipped: false };

/** By how much a relative distance grows when R can be no more than half the part's shorter side. */
function growthOfValue(s: ManifestScale, displayedPx: number, part: VisiblePart): number {
  if (!(s.p95 > 0) || s.displayPxError >= anyDisplayPx) return 1;
  const halfWidthPx = Math.min(part.widthPx, part.heightPx) / 2;
  const value = displayedPx / s.displayPxError / halfWidthPx;
  return Math.max(1, value / s.p95);
}

function accepts(scales: readonly ManifestScale[], k: number, displayedPx: number, part: VisiblePart,
    rule: StepRule): boolean {
  const s = scales[k];
  if (rule === 'jnd')
    return Math.max(part.widthPx, part.heightPx) * growthOfValue(s, displayedPx, part) <= s.displayPxJnd;
  const growth = rule === 'distance' ? growthOfValue(s, displayedPx, part) : 1;
  return displayedPx * growth <= limitOf(scales, k, rule);
}

/**
 * The scale for an object displayed `displayedPx` high (the whole of it, seen or not) of which only a part is
 * visible (Fig. 7.5). Nothing visible: the coarsest scale. Not clipped: by the step function.
 */
export function selectScale(manifest: Manifest, displayedPx: number, part: VisiblePart = wholeObject,
    rule: StepRule = 'flip'): number {
  const { scales } = manifest;
  if (!part.clipped) return scaleAt(stepFunction(scales, rule), displayedPx);
  if (!(part.widthPx > 0 && part.heightPx > 0)) return scales[scales.length - 1].scale;
  for (let k = scales.length - 1; k >= 1; --k)
    if (accepts(scales, k, displayedPx, part, rule)) return scales[k].scale;
  return scales[0].scale;
}
