import { qualityPath } from './entry_paths';
import { JsonAt, parseJson } from './json_fields';

/** Measured quality of scale x rung samples: quality.json (format/SPEC.md, section 11). */
export interface QualityTable {
  views: number;
  sizePx: number;
  /** Scale numbers, rising. */
  scales: number[];
  /** IJG qualities, rising. */
  rungs: number[];
  /** [scale index * rungs + rung index] SSIM of pictures, 1 = equal. */
  ssim: Float32Array;
  /** Mean FLIP of pictures in the same shape, 0 = equal. */
  difference: Float32Array;
}

function readRising(at: JsonAt, least: number, most: number): number[] {
  const values: number[] = [];
  for (let i = 0, n = at.array(1, 100); i < n; ++i) {
    const v = at.at(i).integer(least, most);
    if (i > 0 && v <= values[i - 1]) at.at(i).fail('a rising number', `${v}`);
    values.push(v);
  }
  return values;
}

function readFractions(at: JsonAt, count: number): Float32Array {
  at.array(count, count);
  return Float32Array.from({ length: count }, (_, i) => at.at(i).number(0, 1));
}

/** Reads quality.json, strictly; FormatError names the place in the document. */
export function readQuality(json: Uint8Array): QualityTable {
  const at = parseJson(json, qualityPath, 4 << 20);
  const views = at.at('views').integer(1, 10000);
  const sizePx = at.at('sizePx').integer(1, 65536);
  const scales = readRising(at.at('scales'), 0, 99);
  const rungs = readRising(at.at('rungs'), 1, 100);
  const count = scales.length * rungs.length;
  return {
    views, sizePx, scales, rungs,
    ssim: readFractions(at.at('ssim'), count),
    difference: readFractions(at.at('difference'), count),
  };
}
