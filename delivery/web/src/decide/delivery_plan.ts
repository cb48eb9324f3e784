import { startBytes } from '../format/layout';
import type { Manifest } from '../format/manifest';
import type { PackageData } from '../format/package_data';
import { HtcOptions, defaultHtcOptions, planOptions } from './harmonic_time';
import { LinkOptions, fetchedS } from './network_model';
import { InTime, choiceInTime } from './scale_choice';
import { StepRule, selectScale } from './viewing';

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
  /** Its time limit, round trip and first throughput are set from the others. */
  htc: HtcOptions;
  link: LinkOptions;
}
/** 1000 px, 5 s, 100 kB/s. */
export function defaultDeliveryRequest(): DeliveryRequest {
  const link = { bytesS: 1e5, rttS: 0, connections: 6 };
  return { displayedPx: 1000, rule: 'flip', scale: -1, timeLimitS: 5, beta0BytesS: 0, htc: defaultHtcOptions(), link };
}

/** The delivery that a viewer will get. */
export interface DeliveryPlan extends InTime {
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

/** Bytes of begin .. end behind those that the first request has brought. */
const beyondStart = (begin: number, end: number): number => end - Math.min(end, Math.max(begin, startBytes));
/** Bytes of the first request; provenance.json is the last entry. */
const firstBytes = ({ provenance }: Manifest): number => Math.min(startBytes, provenance.offset + provenance.bytes);

/** When the fixed parts are there. */
function timesOf(m: Manifest, link: LinkOptions, scale: number) {
  const coarsest = m.scales[m.scales.length - 1];
  const firstPictureBytes = beyondStart(coarsest.glb.offset, coarsest.glb.offset + coarsest.glb.bytes);
  const mesh = scale === coarsest.scale ? undefined : m.scales.find((s) => s.scale === scale);
  // One range: index, textures.json, quality.json, table streams and tables.
  const tableBytes = beyondStart(m.index.offset, m.tables.offset + m.tables.bytes);
  const moved = firstPictureBytes + (mesh?.glb.bytes ?? 0) + tableBytes;
  const manifestS = fetchedS(link, 0, firstBytes(m));
  const firstPictureS = fetchedS(link, manifestS, firstPictureBytes);
  return { moved, manifestS, firstPictureS, meshS: fetchedS(link, manifestS, moved) };
}

/**
 * Decides as delivery/cpp's plan_delivery over a link of constant rate, to the same bits; undefined when the package
 * has no such scale. The tables of all planes are needed.
 */
export function planDelivery(data: PackageData, request: DeliveryRequest): DeliveryPlan | undefined {
  const { manifest } = data;
  const { link, displayedPx } = request;
  const wanted = wantedScale(manifest, request);
  const steps = choiceInTime(data, {
    displayedPx, wanted, only: request.scale >= 0, connections: link.connections,
    afterMesh: (scale) => {
      const { moved, manifestS, meshS } = timesOf(manifest, link, scale);
      // Where the first request has brought all, that request shows the throughput.
      const [shown, shownS] = moved > 0 ? [moved, meshS - manifestS] : [firstBytes(manifest), manifestS];
      const initialBytesS = request.beta0BytesS > 0 ? request.beta0BytesS : shown / Math.max(1e-9, shownS - link.rttS);
      const throughput = { ...request.htc.throughput, initialBytesS };
      const htc = { ...request.htc, timeLimitS: request.timeLimitS - meshS, rttS: link.rttS, throughput };
      return { plan: planOptions(htc), linkBytesS: link.bytesS };
    },
  });
  let at = steps.next();
  while (!at.done) at = steps.next();
  const best = at.value;
  if (!best) return undefined;
  const { moved, firstPictureS, meshS } = timesOf(manifest, link, best.scale);
  return { ...best, fixedBytes: firstBytes(manifest) + moved, firstPictureS, meshS, completeS: meshS + best.endS };
}
