import { startBytes } from '../format/layout';
import { type Manifest, firstPicture } from '../format/manifest';
import { worthwhileFlip } from '../format/shared_numbers';
import type { PackageData } from '../format/tables';
import { scaleWithin } from './gpu_memory';
import { proxyBytes, scaleBytes, textureBytes } from './gpu_size';
import type { PlanLimits, TimePlanOptions } from './harmonic_time';
import { LinkOptions, fetchedS } from './simulation';
import { beyondStart, proxyBytesBeyondStart, proxyLoss, servingProxy } from './proxy_choice';
import { proxyStep } from './proxy_steps';
import { InTime, type InTimeRequest, choiceInTime } from './scale_choice';
import { everyGroup } from './texture_loss';
import { StepRule, finestShown, selectScale } from './viewing';

/** How somebody looks at the object, and over which link. */
export interface DeliveryRequest {
  /** Displayed height, device px. */
  displayedPx: number;
  rule: StepRule;
  /** Scale by hand; -1: by the rule. */
  scale: number;
  /** Seconds from the first request on. */
  timeLimitS: number;
  /** 0: what the mesh's transfer has shown. */
  beta0BytesS: number;
  link: LinkOptions;
  /** GPU memory for mesh and textures; left out: any. What is least takes its place where nothing fits. */
  memoryBytes?: number;
  /** The plan by which fragments are fetched; left out: that of loads with the policy guard. */
  plan?: (options: PlanLimits) => TimePlanOptions;
  /** The policy thesis: see asPrinted() of texmesh/thesis. */
  textures?: InTimeRequest['textures'];
}
/** 1000 px, 5 s, 100 kB/s. */
export function defaultDeliveryRequest(): DeliveryRequest {
  const link = { bytesS: 1e5, rttS: 0, connections: 6 };
  return { displayedPx: 1000, rule: 'flip', scale: -1, timeLimitS: 5, beta0BytesS: 0, link };
}

/** The delivery that a viewer will get. */
export interface DeliveryPlan extends InTime {
  /** The proxy that is shown instead of a scale: nothing else is fetched, and `scale` is the coarsest one. */
  proxy?: number;
  /** The larger proxy that is shown on the way to the scale. */
  step?: { proxy: number; atS: number };
  /** On the GPU, at most: buffers, and textures with mip levels. Main memory keeps the buffers, too. */
  gpuBytes: { mesh: number; textures: number };
  /** Besides fragments. */
  fixedBytes: number;
  firstPictureS: number;
  /** The chosen scale and all tables are there. */
  meshS: number;
  completeS: number;
}

/** The scale that the request asks for: its own, or the rule's. */
export function wantedScale(manifest: Manifest, { scale, displayedPx, rule }: DeliveryRequest): number {
  return scale >= 0 ? scale : selectScale(manifest, displayedPx, undefined, rule);
}

/** Bytes of the first request; provenance.json is the last entry. */
const firstBytes = ({ provenance }: Manifest): number =>
  Math.min(startBytes, provenance.offset + provenance.bytes);

/** When the first picture is there, and the mesh: the last request moved `moved` bytes from `fromS` on. */
function timesWith(m: Manifest, link: LinkOptions, more: number) {
  const { offset, bytes } = firstPicture(m);
  const firstPictureBytes = beyondStart(offset, offset + bytes);
  const moved = firstPictureBytes + more;
  const fromS = fetchedS(link, 0, firstBytes(m));
  const firstPictureS = fetchedS(link, fromS, firstPictureBytes);
  return { moved, fromS, firstPictureS, meshS: fetchedS(link, fromS, moved),
    allBytes: firstBytes(m) + moved };
}
/** The smallest proxy is shown first, whatever it takes. */
const proxyFits = (m: Manifest, proxy: number, memoryBytes = Infinity): boolean =>
  proxy === 0 || proxyBytes(m.proxies[proxy]) <= memoryBytes;

/** The larger proxy that comes before documents and mesh. */
function stepOf(m: Manifest, request: DeliveryRequest, firstPictureS: number, manifestS: number) {
  const { link, displayedPx, scale, rule, textures, beta0BytesS, timeLimitS, memoryBytes = Infinity } =
    request;
  if (scale >= 0 || rule !== 'flip' || textures || m.proxies.length === 0) return undefined;
  const bytesS = beta0BytesS > 0 ? beta0BytesS : firstBytes(m) / Math.max(1e-9, manifestS - link.rttS);
  const wanted = scaleWithin(m.scales, selectScale(m, displayedPx, undefined, rule), memoryBytes);
  const proxy =
    proxyStep(m, wanted, displayedPx, { bytesS, rttS: link.rttS, leftS: timeLimitS - firstPictureS });
  return proxy < 0 || !proxyFits(m, proxy, memoryBytes) ? undefined
    : { proxy, atS: fetchedS(link, firstPictureS, proxyBytesBeyondStart(m, proxy)) };
}
/** When the fixed parts of a scale are there. */
function timesOf(m: Manifest, request: DeliveryRequest, scale: number) {
  const { link } = request;
  const { scale: coarsest, glb } = m.scales[m.scales.length - 1];
  const mesh = scale === coarsest ? undefined : m.scales.find((s) => s.scale === scale);
  // One range: index, textures.json, quality.json, table streams and tables.
  const tableBytes = beyondStart(m.index.offset, m.tables.offset + m.tables.bytes);
  const materials = m.proxies.length > 0 ? beyondStart(glb.offset, glb.offset + glb.bytes) : 0;
  const fixed = (mesh?.glb.bytes ?? 0) + materials + tableBytes;
  const times = timesWith(m, link, fixed);
  const step = stepOf(m, request, times.firstPictureS, times.fromS);
  if (!step) return { ...times, step };
  const allBytes = times.allBytes + proxyBytesBeyondStart(m, step.proxy);
  return { ...times, step, moved: fixed, fromS: step.atS, meshS: fetchedS(link, step.atS, fixed), allBytes };
}
/** A proxy alone. */
function planOfProxy(m: Manifest, { link, displayedPx, timeLimitS }: DeliveryRequest,
    proxy: number): DeliveryPlan {
  const { allBytes, firstPictureS, meshS } = timesWith(m, link, proxyBytesBeyondStart(m, proxy));
  const mesh = scaleBytes(m.proxies[proxy]);
  const { flip } = proxyLoss(m, proxy, displayedPx);
  const none = everyGroup(0);
  return {
    scale: m.scales[m.scales.length - 1].scale, proxy, planes: [], rungs: [], bytes: 0, endS: 0,
    leftS: timeLimitS - meshS,
    list: { offers: [], fragments: [], groups: [], groupWeights: everyGroup(1), previewLoss: none },
    flip, textureFlip: flip, fixedBytes: allBytes, firstPictureS, meshS, completeS: meshS,
    gpuBytes: { mesh, textures: proxyBytes(m.proxies[proxy]) - mesh },
  };
}

/**
 * Decides as delivery/cpp's plan_delivery over a link of constant rate, to the same bits; undefined when the
 * package has no such scale. The tables of all planes are needed.
 */
export function planDelivery(data: PackageData, request: DeliveryRequest): DeliveryPlan | undefined {
  const { manifest } = data;
  const { link, displayedPx } = request;
  const { scale, rule, timeLimitS } = request;
  const { textures, memoryBytes = Infinity } = request;
  const plan = request.plan ?? ((options) => ({ policy: 'guard', order: 'finest', ...options }));
  const only = scale >= 0 || !!textures;
  const serving = !only && rule === 'flip' ? servingProxy(manifest, displayedPx) : -1;
  if (serving >= 0 && proxyFits(manifest, serving, memoryBytes)) {
    const alone = planOfProxy(manifest, request, serving);
    if (alone.completeS <= timeLimitS) return alone;
  }
  const asked = wantedScale(manifest, request);
  const wanted = only ? asked : scaleWithin(manifest.scales, asked, memoryBytes);
  const finest = rule === 'flip'
    ? scaleWithin(manifest.scales, finestShown(manifest.scales, displayedPx), memoryBytes) : undefined;
  const steps = choiceInTime(data, {
    displayedPx, wanted, finest, only, textures, memoryBytes, connections: link.connections,
    afterMesh: (scale) => {
      const { moved, fromS, meshS } = timesOf(manifest, request, scale);
      // Where the first request has brought all, that request shows the throughput.
      const [shown, shownS] = moved > 0 ? [moved, meshS - fromS] : [firstBytes(manifest), fromS];
      const initialBytesS = request.beta0BytesS > 0 ? request.beta0BytesS
        : shown / Math.max(1e-9, shownS - link.rttS);
      const left = { timeLimitS: timeLimitS - meshS, initialBytesS, rttS: link.rttS };
      return { plan: plan(left), linkBytesS: link.bytesS };
    },
  });
  let at = steps.next();
  while (!at.done) at = steps.next();
  const best = at.value;
  if (!best) return undefined;
  const { allBytes, firstPictureS, meshS, step } = timesOf(manifest, request, best.scale);
  const shown = manifest.scales.find((s) => s.scale === best.scale)!;
  const textureSum = best.planes.reduce((sum, { plane }) =>
    sum + textureBytes(data.textures[plane].widthPx, data.textures[plane].heightPx), 0);
  let chosen: DeliveryPlan = {
    ...best, step, fixedBytes: allBytes, firstPictureS, meshS, completeS: meshS + best.endS,
    gpuBytes: { mesh: scaleBytes(shown), textures: textureSum },
  };
  if (!only)
    manifest.proxies.forEach((_, k) => {
      if (!proxyFits(manifest, k, memoryBytes)) return;
      const other = planOfProxy(manifest, request, k);
      const needed = chosen.meshS >= timeLimitS && other.meshS < chosen.meshS;
      if (needed || (other.meshS < timeLimitS && other.flip < chosen.flip - worthwhileFlip)) chosen = other;
    });
  return chosen;
}
