// Places of the probabilities of the connectivity part: the kinds of SplitModels in format/split/codec/split_models.h, and how many contexts
// each kind has.

export const degrees = 14;
export const lefts = 12;
export const runs = 7;
export const rings = 8;
export const valences = 5;

let count = 0;
const block = (models: number): number => {
  const at = count;
  count += models;
  return at;
};
export const ask = block(degrees * 4 * 2 * 2);
export const first = block(lefts * 2);
export const turn = block(2 * 2 * lefts * valences);
export const turnBack = block(2 * 2 * runs * rings * valences);
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
