import type { PlaneThesis } from '../../format/thesis/thesis_tables';
import { exp, log } from '../portable_math';

// The thesis's size model of a fragment (8.5 to 8.9): format/rules/size_model.cpp, bit for bit.

/** Least VQP that has a model. */
const leastVqp = 0.02;
const logR = (t: PlaneThesis, fragment: number): number => t.sizeB[fragment] * log(100 * Math.max(t.vqp[fragment], leastVqp));
const hasModel = (t: PlaneThesis, fragment: number): boolean => t.sizeA[fragment] > 0 && t.sizeB[fragment] > 0;

/** (8.5): bytes of a fragment at a quality in 0..1; 0 without a model. */
export const modelledBytes = (t: PlaneThesis, fragment: number, quality: number): number =>
  hasModel(t, fragment) ? t.sizeA[fragment] * exp(quality * logR(t, fragment)) : 0;
/** (8.9): the quality whose bytes these are (> 0). Not clipped to 0..1; 0 without a model. */
export const modelledQuality = (t: PlaneThesis, fragment: number, bytes: number): number =>
  hasModel(t, fragment) && bytes > 0 ? (log(bytes) - log(t.sizeA[fragment])) / logR(t, fragment) : 0;
