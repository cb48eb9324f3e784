import type { Manifest, ManifestScale } from '../format/manifest';
import { meshTimeShare, moments, mostStepTime, paying } from '../format/shared_numbers';
import { pow } from './portable_math';
import { beyondStart, proxyBytesBeyondStart, proxyLoss } from './proxy_choice';

// Which larger proxy is shown on the way from the smallest one to a scale, from the numbers of the manifest
// alone: format/rules/proxy_choice.cpp, bit for bit, but for what comes ahead of another proxy.

/** A link as the first request has shown it, and the seconds that are left until the time limit. */
export interface StepLink {
  bytesS: number;
  rttS: number;
  leftS: number;
}

/** Bytes behind the first request that a package with proxies needs before scales can be chosen. */
export function documentBytes({ index, tables, scales }: Manifest): number {
  const { offset, bytes } = scales[scales.length - 1].glb;
  return beyondStart(index.offset, tables.offset + tables.bytes) + beyondStart(offset, offset + bytes);
}

/**
 * The proxy that comes in the first twentieth of the time left and lowers the mean FLIP of what is seen in
 * that time by at least a twentieth, of several the one that lowers it most; -1 where none does. What scales
 * look like is supposed, see SPEC.md, A.6.
 */
export function proxyStep(m: Manifest, wanted: number, displayedPx: number,
    { bytesS, rttS, leftS }: StepLink): number {
  if (m.proxies.length < 2 || !(leftS > 0) || !(bytesS > 0)) return -1;
  const seconds = (bytes: number): number => rttS + bytes / bytesS;
  const flips = m.proxies.map((_, k) => proxyLoss(m, k, displayedPx).flip);
  const arrivalS = (k: number): number => seconds(proxyBytesBeyondStart(m, k));
  const documents = documentBytes(m);
  const inTime = ({ glb }: ManifestScale): boolean => seconds(documents + glb.bytes) <= meshTimeShare * leftS;
  const mesh = m.scales.slice(0, -1).find((s) => s.scale >= wanted && inTime(s));
  const tooCoarse = !mesh && m.scales[m.scales.length - 1].scale > wanted;
  const fixed = documents + (mesh?.glb.bytes ?? 0);
  const all = m.provenance.offset + m.provenance.bytes;
  const largest = m.proxies[m.proxies.length - 1].glb.bytes;
  /** Mean FLIP in the time left; 0: without a step. */
  const mean = (step: number): number => {
    const stepS = step > 0 ? arrivalS(step) : 0;
    const meshS = stepS + seconds(fixed);
    const endS = Math.min(leftS, meshS + all / bytesS);
    const first = Math.max(tooCoarse ? flips[0] : flips[flips.length - 1], 1e-6);
    const bytes = Math.min(all, (leftS - stepS) * bytesS);
    const last = tooCoarse ? first : Math.max(1e-6, first * Math.sqrt(largest / Math.max(largest, bytes)));
    let sum = 0;
    for (let i = 0; i < moments; ++i) {
      const t = ((i + 0.5) / moments) * leftS;
      const scale = t < meshS ? 1
        : t >= endS ? last : first * pow(last / first, (t - meshS) / (endS - meshS));
      sum += t < stepS ? flips[0] : Math.min(flips[step], scale);
    }
    return sum / moments;
  };
  let least = paying * mean(0);
  let best = -1;
  for (let k = 1; k < flips.length; ++k) {
    if (!(flips[k] < flips[0]) || arrivalS(k) >= mostStepTime * leftS) continue;
    const now = mean(k);
    if (now > least || (best >= 0 && now === least)) continue;
    least = now;
    best = k;
  }
  return best;
}

/**
 * The next proxy behind `shown` on the way to the largest one that comes in time and looks better than scales
 * do then: a smaller one where both come in time and the mean FLIP in the time left falls by a twentieth at
 * least. -1: none.
 */
export function proxyAhead(m: Manifest, shown: number, displayedPx: number, { bytesS, rttS, leftS }: StepLink,
    scales: { flip: number; fits(proxy: number): boolean }): number {
  const flips = m.proxies.map((_, k) => proxyLoss(m, k, displayedPx).flip);
  const takesS = (k: number): number => rttS + proxyBytesBeyondStart(m, k) / bytesS;
  let last = flips.length - 1;
  while (last > shown && !(scales.fits(last) && takesS(last) < leftS && flips[last] < scales.flip)) --last;
  if (last <= shown) return -1;
  /** FLIP times seconds: `first` comes before the last one. */
  const seen = (first: number, firstS: number): number => flips[shown] * firstS +
    flips[first] * takesS(last) + flips[last] * (leftS - firstS - takesS(last));
  let next = last;
  let least = paying * seen(shown, 0);
  for (let k = shown + 1; k < last; ++k) {
    const now = seen(k, takesS(k));
    if (takesS(k) + takesS(last) < leftS && scales.fits(k) && now < least) [least, next] = [now, k];
  }
  return next;
}
