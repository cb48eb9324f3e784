import { scaleWithin } from '../../decide/memory/gpu_memory';
import { proxyBytes } from '../../decide/memory/gpu_size';
import { proxyBytesBeyondStart, proxyLoss } from '../../decide/proxy_choice';
import { proxyStep } from '../../decide/proxy_steps';
import { throughputOf } from '../../decide/request_groups';
import { worthwhile } from '../../decide/scale_choice';
import { selectScale } from '../../decide/viewing';
import type { LoadContext } from '../load_context';

// Which larger proxy a load shows besides the smallest one.

/** Proxies on the way to scales are chosen as if the limit were no longer. */
const longestStepS = 60;

/** Throughput that whoever gave the load its turn expects, that options say, or that transfers have shown. */
export function throughputBytesS({ expectedBytesS, options: { beta0BytesS }, reader: { requests, client } }: LoadContext): number {
  return expectedBytesS || beta0BytesS || throughputOf(requests, client.latencyS);
}

const fits = ({ memoryBytes, reader: { manifest } }: LoadContext, proxy: number): boolean => proxyBytes(manifest.proxies[proxy]) <= memoryBytes;

/** The larger proxy that pays on the way to scales; -1: none does. */
export function stepOf(load: LoadContext): number {
  const { reader: { manifest, client }, view: { display: { heightPx, part } }, memoryBytes } = load;
  const wanted = scaleWithin(manifest.scales, selectScale(manifest, heightPx, part), memoryBytes);
  const leftS = Math.min(load.limitS, longestStepS) - load.elapsedS();
  const step = proxyStep(manifest, wanted, heightPx, { bytesS: throughputBytesS(load), rttS: client.latencyS, leftS });
  return step >= 0 && fits(load, step) ? step : -1;
}

/** The largest proxy behind `shown` that comes in the time left and looks better than scales do at its end; -1: none does. */
export function betterThanScales(load: LoadContext, shown: number, flip: number, leftS: number): number {
  const { reader: { manifest, client }, view: { display: { heightPx } }, beta0 } = load;
  const better = (k: number): boolean =>
    fits(load, k) && client.latencyS + proxyBytesBeyondStart(manifest, k) / beta0 < leftS && proxyLoss(manifest, k, heightPx).flip < flip - worthwhile;
  let k = manifest.proxies.length - 1;
  while (k > shown && !better(k)) --k;
  return k > shown ? k : -1;
}
