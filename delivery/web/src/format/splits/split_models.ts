import {
  splitDegrees, splitLefts, splitModelLimit, splitRings, splitRuns, splitValences,
} from '../shared_numbers';

// Places of the probabilities of the connectivity part: the kinds of SplitModels in
// format/split/split_element_codec.h, and how many contexts each kind has.

export {
  splitDegrees as degrees, splitLefts as lefts, splitModelLimit as limit, splitRings as rings,
  splitRuns as runs,
  splitValences as valences,
};

let count = 0;
const block = (models: number): number => {
  const at = count;
  count += models;
  return at;
};
export const ask = block(splitDegrees * 4 * 2 * 2);
export const first = block(splitLefts * 2);
export const turn = block(2 * 2 * splitLefts * splitValences);
export const turnBack = block(2 * 2 * splitRuns * splitRings * splitValences);
export const turnAgain = block(4);
export const targetExpected = block(2);
export const targetCopied = block(2);
export const listedModel = block(1);
export const moreFaces = block(8);
export const flippedModel = block(1);
export const extraFace = block(1);
export const sameGroup = block(1);
export const besideMoving = block(3);
export const cornerExpected = block(6);
export const seedExists = block(1);
export const gateOpen = block(64);
export const thirdNew = block(64);
export const thirdLeft = block(64);
export const thirdRight = block(1);
export const patchExpected = block(4);
/** Number of all probabilities. */
export const modelCount = count;
