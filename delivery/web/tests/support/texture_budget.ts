import { bytesAtRung } from '../../src/decide/harmonic_time';
import { type PackageData, TextureLoss, type TextureSpending, budgetSteps } from '../../src/reader';

/** The best texture that so many bytes can show, and the bytes of its fragments. */
export function textureForBudget(data: PackageData, displayedPx: number, scale: number,
    bytes: number): TextureSpending & { bytes: number } {
  const best = [...budgetSteps(new TextureLoss(data, displayedPx), { scale }, bytes)].pop()!;
  return { ...best, bytes: best.list.offers.reduce((sum, f, i) => sum + bytesAtRung(f, best.rungs[i]), 0) };
}
