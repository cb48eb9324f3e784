import { startBytes } from '../format/layout';
import type { Manifest } from '../format/manifest';
import { ln2, proxyLossPerDoubling, sameFlip, sameFlipP95 } from '../format/shared_numbers';
import { log, pow } from './portable_math';

// Which proxies are enough, from the manifest alone: format/rules/proxy_choice.cpp, bit for bit.

/** FLIP of lit pictures of a proxy against S_0 with the source's textures: mean and 95th percentile. */
export interface ProxyLoss {
  flip: number;
  flipP95: number;
}

function lossAt(sizes: readonly number[], losses: readonly number[], displayedPx: number): number {
  const px = Math.max(displayedPx, 1);
  const last = sizes.length - 1;
  if (px <= sizes[0]) return losses[0];
  const doublings = log(px / sizes[last]) / ln2;
  if (px >= sizes[last]) return Math.min(1, losses[last] * pow(proxyLossPerDoubling, doublings));
  const i = sizes.findIndex((size) => size >= px) - 1;
  const from = log(sizes[i]);
  const part = (log(px) - from) / (log(sizes[i + 1]) - from);
  return (1 - part) * losses[i] + part * losses[i + 1];
}

/** At a displayed height in px, read between the measured heights. */
export function proxyLoss({ proxies, proxySizesPx }: Manifest, proxy: number,
    displayedPx: number): ProxyLoss {
  const { flip, flipP95 } = proxies[proxy];
  return { flip: lossAt(proxySizesPx, flip, displayedPx),
    flipP95: lossAt(proxySizesPx, flipP95, displayedPx) };
}
/** The smallest proxy, of few bytes, that cannot be told from S_0 at that height; -1 where there is none. */
export function servingProxy(manifest: Manifest, displayedPx: number): number {
  return manifest.proxies.findIndex(({ glb }, k) => {
    const { flip, flipP95 } = proxyLoss(manifest, k, displayedPx);
    return flip <= sameFlip && flipP95 <= sameFlipP95 && glb.bytes <= startBytes;
  });
}
/** Bytes of begin .. end behind those that the first request has brought. */
export const beyondStart = (begin: number, end: number): number =>
  end - Math.min(end, Math.max(begin, startBytes));
/** Bytes behind the first picture that are fetched for a proxy. */
export function proxyBytesBeyondStart({ proxies }: Manifest, proxy: number): number {
  const { offset, bytes } = proxies[proxy].glb;
  return proxy === 0 ? 0 : beyondStart(offset, offset + bytes);
}
