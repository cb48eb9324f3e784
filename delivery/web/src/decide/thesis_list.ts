import { gammaBisections, highestPrinted } from '../format/shared_numbers';
import type { PackageData } from '../format/tables';
import { transferRate } from '../http/throughput';
import { qualityOf } from './allocation';
import type { DeliveryRequest } from './delivery_plan';
import { type FragmentList, type ListOptions, fragmentList } from './fragment_list';
import { type PlanLimits, type TimePlanOptions, meanOffer } from './harmonic_time';
import { interpolatedBytes } from './size_curve';
import { type PlaneChoice, type TextureLoss, planesForDisplay, tablesOf } from './texture_loss';

export { coarsestAlike } from './own_jnd';

// Chapter 4 as printed: gamma_for_bytes, thesis_textures and as_printed of delivery/cpp, bit for bit.

/** The Gamma whose list comes to so many bytes, D_i(Gamma) = D_1, by bisection; 0 or 1 where no list does. */
export function gammaForBytes(data: PackageData, planes: readonly PlaneChoice[], scale: number,
    bytes: number): number {
  const row = data.manifest.scales.findIndex((s) => s.scale === scale);
  const bytesAt = (gamma: number): number => {
    let sum = 0;
    for (const { plane } of planes) {
      const t = tablesOf(data, plane);
      const quality = qualityOf(t, row, gamma);
      for (const f of t.order) sum += Math.max(1, interpolatedBytes(t, f, quality[f]));
    }
    return sum;
  };
  let [low, high] = [0, 1];
  if (bytesAt(low) <= bytes) return low;
  if (bytesAt(high) >= bytes) return high;
  for (let i = 0; i < gammaBisections; ++i) {
    const middle = (low + high) / 2;
    if (bytesAt(middle) > bytes) low = middle;
    else high = middle;
  }
  return high;
}

/** All fragments as printed: etas from Gamma, limits Q_i - dQ and Q_i + dQ, and F-bar (at Gamma) at Q_i. */
function asPrintedList(data: PackageData, { offers, fragments }: FragmentList,
    { scale, gamma, qualityLow }: ListOptions): void {
  const row = data.manifest.scales.findIndex((s) => s.scale === scale);
  offers.forEach((offer, i) => {
    const { quality: { [row]: middle }, qualityWidth, rungQuality } = tablesOf(data, fragments[i].plane);
    const [low, high] = [Math.max(qualityLow, middle - qualityWidth),
      Math.min(highestPrinted, middle + qualityWidth)];
    offer.eta -= gamma;
    offer.highRung = Math.max(rungQuality.filter((q) => q <= high).length - 1, 0);
    offer.lowRung = Math.min(rungQuality.filter((q) => q < low).length, rungQuality.length - 1,
      offer.highRung);
  });
  if (offers.length === 0) return;
  const nearest = meanOffer(offers, true);
  const { plane, fragment } = fragments[nearest];
  const t = tablesOf(data, plane);
  offers[nearest].plannedBytes = Math.max(1, interpolatedBytes(t, fragment, t.quality[row]));
}

/** Chapter 4's textures for so many bytes, of the display's resolution (8.1.1): D_i(Gamma) comes to that. */
export interface ThesisTextures {
  planes: PlaneChoice[];
  options: Partial<ListOptions>;
  list: FragmentList;
}
/** The textures that so many bytes show of a scale. */
export function thesisTextures(loss: TextureLoss, scale: number, bytes: number): ThesisTextures {
  const planes = planesForDisplay(loss.data, loss.displayedPx);
  const options = { scale, displayedPx: loss.displayedPx, printed: asPrintedList,
    gamma: gammaForBytes(loss.data, planes, scale, bytes) };
  return { planes, options, list: fragmentList(loss.data, planes, options, loss) };
}

/**
 * The plan as printed: order by beta_0, one request at a time, each with a round trip of its own; never below
 * the lower limit, nothing skipped; the last transfer tells the throughput.
 */
export function printedPlan(options: PlanLimits): TimePlanOptions {
  const rate = transferRate(options.initialBytesS);
  return {
    policy: 'thesis', order: 'beta0', ...options, leastInFlight: 1, mostInFlight: 1,
    latencyS: 0, waitS: options.rttS, rate, estimate: () => rate.recentBytesS(1),
    lowestRung: (f) => Math.min(f.lowRung, f.bytes.length - 1), skips: false,
  };
}

/** The request with the policy thesis; its distance says which scale is enough. */
export const asPrinted = (request: DeliveryRequest): DeliveryRequest =>
  ({ ...request, rule: 'distance', textures: thesisTextures, plan: printedPlan });
