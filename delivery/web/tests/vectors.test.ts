import { readdirSync } from 'node:fs';
import { join } from 'node:path';
import { describe, expect, it } from 'vitest';
import { acuityAt, gazeWeight } from '../src/scene/gaze_weights';
import * as t from '../src/reader';
import { asPrinted } from '../src/thesis';
import { SplitStreamReader } from '../src/format/splits/split_stream';
import { readBytes, readText, root, sameBits } from './support/files';
import { textureForBudget } from './support/texture_budget';

// Every decision that delivery/cpp takes, to the same bits (delivery/vectors/README.md).

type Json = any;

const camel = (name: string): string => name.replace(/_(\w)/g, (_, c: string) => c.toUpperCase());
/** Names of C++ to those of TypeScript, all the way down. */
function camelCased(value: Json): Json {
  if (Array.isArray(value)) return value.map(camelCased);
  if (value === null || typeof value !== 'object') return value;
  return Object.fromEntries(Object.entries(value).map(([k, v]) => [camel(k), camelCased(v)]));
}

function expectBits(found: ArrayLike<number>, expected: ArrayLike<number>, what: string): void {
  expect(found.length, what).toBe(expected.length);
  for (let i = 0; i < expected.length; ++i)
    if (!sameBits(found[i], expected[i])) expect(found[i], `${what}[${i}]`).toBe(expected[i]);
}

function runMath(cases: Json[]): void {
  const functions: Record<string, (x: number) => number> = {
    ...t.portable,
    log_quantiser: t.logQuantiser,
    acuity: acuityAt,
    gaze_weight: gazeWeight,
    'pow of 0.37': (y: number) => t.portable.pow(0.37, y),
  } as never;
  for (const c of cases)
    it(c.name, () => {
      for (const [x, y] of c.x_y) expectBits([functions[c.name](x)], [y], `${c.name}(${x})`);
    });
}

/** Policies and estimators that only the laboratory has are not held here. */
const isKnown = ({ policy, throughput: { estimator } }: Json): boolean =>
  ['guard', 'thesis'].includes(policy) && estimator !== 'ewma';

function runThroughput(cases: Json[]): void {
  for (const { name, options: { estimator, samples, initial_bytes_s }, ...c } of cases)
    it.skipIf(estimator === 'ewma')(name, () => {
      const rate = t.transferRate(initial_bytes_s);
      for (const [bytes, seconds, estimate, recent] of c.add_bytes_seconds_then_bytes_s_and_recent_3) {
        rate.add(bytes, seconds);
        const found = [rate.recentBytesS(estimator === 'last' ? 1 : samples), rate.recentBytesS(3)];
        expectBits(found, [estimate, recent], 'estimates');
      }
    });
}

function runProxySteps(c: Json): void {
  const glb = ({ offset, bytes }: Json) => ({ offset, bytes });
  const { index, tables, provenance } = c;
  const scales = c.scales.map((s: Json) => ({ scale: s.scale, glb: glb(s) }));
  const proxies = c.proxies.map((p: Json) => ({ glb: glb(p), flip: p.flip, flipP95: p.flip_p95 }));
  const manifest =
    { proxySizesPx: c.sizes_px, proxies, scales, index, tables, provenance } as unknown as t.Manifest;
  expect(t.documentBytes(manifest)).toBe(c.document_bytes);
  for (const [wanted, px, bytesS, leftS, step] of c.wanted_px_bytes_s_left_s_step)
    expect(t.proxyStep(manifest, wanted, px, { bytesS, rttS: 0.04, leftS }),
      `${wanted}, ${px}, ${bytesS}, ${leftS}`).toBe(step);
}
function runGpuSizes({ textures, meshes }: Json): void {
  for (const [w, h, ...bytes] of textures)
    expect((['rgba8', 'block8', 'block16'] as const).map((texels) => t.textureBytes(w, h, undefined, texels)),
      `${w} x ${h}`).toEqual(bytes);
  for (const [vertices, triangles, bytes] of meshes)
    expect(t.scaleBytes({ vertices, triangles })).toBe(bytes);
}

function runProxies(cases: Json[]): void {
  for (const c of cases)
    it(c.name, () => {
      if (c.meshes) return runGpuSizes(c);
      if (c.scales) return runProxySteps(c);
      const glb = ({ offset, bytes }: Json) => ({ offset, bytes });
      const proxies = c.proxies.map((p: Json) => ({ glb: glb(p), flip: p.flip, flipP95: p.flip_p95 }));
      const manifest = { proxySizesPx: c.sizes_px, proxies } as unknown as t.Manifest;
      c.proxies.forEach((p: Json, k: number) =>
        expect(t.proxyBytesBeyondStart(manifest, k)).toBe(p.bytes_beyond_start));
      for (const [px, losses, serving] of c.px_losses_serving) {
        expect(t.servingProxy(manifest, px)).toBe(serving);
        losses.forEach((expected: number[], k: number) => {
          const { flip, flipP95 } = t.proxyLoss(manifest, k, px);
          expectBits([flip, flipP95], expected, `proxy ${k} at ${px} px`);
        });
      }
    });
}

/** The options of HtcOptions in delivery/cpp. With one request at a time each has its own round trip. */
function planOptions(
    { policy, order, timeLimitS, rttS, window, maxInFlight, throughput }: Json): t.TimePlanOptions {
  const { estimator, samples, initialBytesS } = throughput;
  const rate = t.transferRate(initialBytesS);
  const [leastInFlight, mostInFlight] = window > 0 ? [window, window] : [undefined, maxInFlight];
  const trips = window === 1 ? { latencyS: 0, waitS: rttS } : {};
  const counted = estimator === 'harmonic' ? samples : window === 1 ? 1 : 10;
  return {
    policy, order, timeLimitS, rttS, initialBytesS, leastInFlight, mostInFlight, ...trips,
    rate, estimate: () => rate.recentBytesS(counted),
  };
}

function runPlan(cases: Json[]): void {
  expect(cases.filter(({ options }) => isKnown(options)).length).toBeGreaterThanOrEqual(8);
  for (const c of cases)
    it.skipIf(!isKnown(c.options))(c.name, () => {
      const options = planOptions(camelCased(c.options));
      const plan = new t.HarmonicTimePlan(camelCased(c.offers), options);
      const end = (offer: number, nowS: number, well: boolean): void =>
        plan.ended(plan.steps.find((s) => s.offer === offer)!, nowS, well);
      c.calls.forEach(([what, ...args]: [string, ...Json[]], i: number) => {
        if (what === 'next') {
          const step: Json = plan.next(args[0]);
          const expected = camelCased(args[1]);
          if (expected === null) expect(step, `call ${i}`).toBeUndefined();
          else
            for (const name of Object.keys(expected))
              expectBits([step[name]], [expected[name]], `call ${i}: ${name}`);
        } else if (what === 'completed' || what === 'failed') end(args[0], args[1], what === 'completed');
        else throw new Error(`unknown call ${what}`);
      });
      const r = camelCased(c.result);
      plan.steps.forEach((s, i) =>
        expectBits([s.offer, s.rung, s.bytes, s.doneS, s.spacingS, s.residualS], r.steps[i], `step ${i}`),
      );
      const rungs =
        c.offers.map((_: Json, offer: number) => plan.steps.find((s) => s.offer === offer)?.rung ?? -1);
      expectBits(rungs, r.rungs, 'rungs');
      const endS = Math.max(...plan.steps.map((s) => s.doneS));
      expectBits([plan.throughputBytesS(), options.timeLimitS - endS], [r.throughputBytesS, r.surplusS],
        'end');
    });
}

function checkViewing(manifest: t.Manifest, v: Json): void {
  const rules = Object.keys(v.rules) as t.StepRule[];
  for (const rule of rules) {
    const steps = t.stepFunction(manifest.scales, rule);
    expectBits(steps.flatMap((s) => [s.upToPx, s.scale]), v.rules[rule].steps.flat(), `steps of ${rule}`);
    for (const [px, scale] of v.rules[rule].displayed_px_scale) expect(t.scaleAt(steps, px)).toBe(scale);
  }
  for (const clip of v.clips) {
    const [widthPx, heightPx, clipped] = clip.part;
    const part: t.VisiblePart = { widthPx, heightPx, clipped };
    for (const rule of rules)
      expect(t.selectScale(manifest, 1200, part, rule)).toBe(clip.scale_of_1200_px[rule]);
  }
  const camera = { fovDegrees: 45, viewportPx: 1080 };
  expectBits([t.displayedHeightPx(manifest.objectHeight, 3 * manifest.objectHeight, camera)],
    [v.displayed_px_at_distance_3_heights], 'displayed height');
}

function checkTables(table: t.PlaneTables, v: Json): void {
  expectBits(t.surfaceWeights(table), v.surface_weights, 'weights');
  for (const s of v.scales) {
    expectBits(t.etaOf(table, s.row), s.eta, 'eta');
    for (const g of s.gammas) {
      const gamma = g.gamma < 0 ? t.meanEta(table, s.row) : g.gamma;
      expectBits(t.qualityOf(table, s.row, gamma), g.quality, 'quality');
    }
  }
  for (const [fragment, quality, bytes] of v.fragment_quality_bytes)
    expectBits([t.interpolatedBytes(table, fragment, quality)], [bytes],
      `bytes of ${fragment} at ${quality}`);
  const bent = { ...table, knotQuality: v.knots.quality, knotPosition: v.knots.position };
  for (const [fragment, quality, bytes] of v.knots.fragment_quality_bytes)
    expectBits([t.interpolatedBytes(bent, fragment, quality)], [bytes],
      `bytes of ${fragment} at ${quality}, knots`);
  const { vqp, density_weight: densityWeight, eta, gamma, quality } = v.by_predictors;
  const predicted = { ...table, allocation: 3, vqp: Float32Array.from(vqp), densityWeight };
  expectBits(t.etaOf(predicted, table.quality.length - 1), eta, 'VQP of the coarsest scale');
  expectBits([t.meanEta(predicted, 0)], [gamma], 'mean of VQP');
  expectBits(t.qualityOf(predicted, 0, gamma), quality, 'quality by VQP');
}

function checkCurves(quality: t.QualityTable, displayedPx: number, v: Json): void {
  for (const { group, dssim_growth_flip, growth_mip_flip } of v.groups) {
    const curve = new t.GroupCurve(quality, group, displayedPx);
    for (const [dssim, growth, flip] of dssim_growth_flip)
      expectBits([curve.coded(dssim, [growth, growth / 2])], [flip],
        `${group} of ${dssim}, ${growth} doublings`);
    for (const [growth, mip, flip] of growth_mip_flip)
      expectBits([curve.halved([growth, growth / 2], mip)], [flip],
        `${group}, ${growth} doublings, mip ${mip}`);
  }
  for (const [scale, flip] of v.scale_flip)
    expectBits([t.geometryFlip(quality, displayedPx, scale)], [flip], `scale ${scale}`);
}

async function checkList(reader: t.PackageReader, v: Json): Promise<void> {
  const data = await reader.data();
  const displayedPx = v.displayed_px;
  checkCurves(data.quality, displayedPx, v.curves);
  const planes = t.planesForDisplay(data, displayedPx);
  expect(planes.map((p) => [p.base, p.plane])).toEqual(v.planes);
  const list = t.fragmentList(data, planes, { scale: v.scale, displayedPx, groupWeights: v.group_weights });
  expect(list.fragments.map((f) => [f.plane, f.fragment])).toEqual(v.fragments);
  camelCased(v.offers).forEach((o: Json, i: number) => {
    for (const name of Object.keys(o))
      expectBits([(list.offers[i] as Json)[name]].flat(), [o[name]].flat(), `offer ${i}: ${name}`);
  });
  expectBits(list.previewLoss, v.preview_loss, 'losses');
  for (const b of v.budgets) {
    const budget = textureForBudget(data, displayedPx, v.scale, b.budget_bytes);
    const what = `budget of ${b.budget_bytes}`;
    expect(budget.planes.map((p) => [p.base, p.plane])).toEqual(b.planes);
    expectBits(budget.list.groupWeights, b.group_weights, what);
    expectBits(budget.rungs, b.rungs, what);
    expectBits(budget.losses, b.losses, what);
    expectBits([budget.bytes, t.textureFlip(data.quality, budget.losses), budget.flip],
      [b.bytes, b.texture_flip, b.flip], what);
  }
}

/** Scale, planes and rungs that a time and a link leave. */
async function checkPlan(reader: t.PackageReader, v: Json): Promise<void> {
  const base = t.defaultDeliveryRequest();
  const asked: t.DeliveryRequest = {
    ...base,
    displayedPx: v.displayed_px,
    timeLimitS: v.time_limit_s,
    memoryBytes: v.memory_bytes ?? undefined,
    plan: (options) => ({ policy: 'guard', order: 'credit', ...options }),
    link: { ...base.link, bytesS: v.bytes_s, rttS: v.rtt_s },
  };
  const request = v.policy === 'thesis' ? asPrinted(asked) : asked;
  const data = await reader.data();
  expect(t.wantedScale(data.manifest, request)).toBe(v.wanted_scale);
  const p = t.planDelivery(data, request)!;
  expect(p.scale).toBe(v.scale);
  expect(p.proxy ?? null).toBe(v.proxy ?? null);
  expect(p.step ? [p.step.proxy, p.step.atS] : null).toEqual(v.step ?? null);
  if (v.gpu_bytes) expect([p.gpuBytes.mesh, p.gpuBytes.textures]).toEqual(v.gpu_bytes);
  expect(p.planes.map((c) => [c.base, c.plane])).toEqual(v.planes);
  expectBits(p.rungs, v.rungs, 'rungs');
  expectBits([p.firstPictureS, p.meshS, p.completeS], v.times_s, 'times');
  expectBits([p.fixedBytes + p.bytes, p.textureFlip, p.flip], [v.bytes, v.texture_flip, v.flip], 'plan');
}

async function digestOf(values: ArrayLike<number> & { buffer: ArrayBufferLike },
    bytesEach = 4): Promise<string> {
  const bytes = new DataView(new ArrayBuffer(values.length * bytesEach));
  for (let i = 0; i < values.length; ++i)
    if (bytesEach === 2) bytes.setUint16(2 * i, values[i], true);
    else bytes.setInt32(4 * i, values[i], true);
  return t.toHex(await t.sha256(new Uint8Array(bytes.buffer)));
}

/** Every scale of the vertex-split stream, to the bit. */
async function checkSplits(reader: t.PackageReader, scales: Json[]): Promise<void> {
  const head = await reader.splitStreamHead();
  if (!head) return expect(scales).toEqual([]);
  const stream = new SplitStreamReader(head);
  for (const [k, s] of stream.head.scales.entries()) {
    const blocks = stream.head.blocks.slice(stream.nextBlock, s.blocks);
    const bytes = blocks.reduce((sum, b) => sum + b.bytes, 0);
    await stream.addBlocks(await reader.splitStream(blocks[0].offset, bytes));
    const { mesh } = stream;
    let visible = 0;
    for (let f = 0; f < mesh.faceCount; ++f) visible += mesh.isVisible(f) ? 1 : 0;
    const used = (g: { data: Int32Array; length: number }): Int32Array => g.data.subarray(0, g.length);
    expect({
      scale: s.scale,
      points: mesh.points,
      wedges: mesh.wedges,
      faces: mesh.faceCount,
      visible_faces: visible,
      points_sha256: await digestOf(used(mesh.places)),
      wedge_points_sha256: await digestOf(used(mesh.wedgePoint)),
      faces_sha256: await digestOf(used(mesh.faces)),
      groups_sha256: await digestOf(used(mesh.faceGroup), 2),
      values_sha256: await Promise.all(mesh.values.map((v) => digestOf(used(v)))),
    }).toEqual(scales[k]);
    expect(visible).toBe(s.triangles);
  }
}

async function runPackages(cases: Json[]): Promise<void> {
  for (const c of cases)
    describe(c.name, async () => {
      const reader = await t.PackageReader.openBytes(readBytes(c.file), c.file);
      it('entries', async () => {
        expect(reader.id).toBe(c.id);
        const entries = (await reader.index()).map((e) => [e.path, e.offset, e.bytes, t.toHex(e.sha256)]);
        expect(entries).toEqual(c.entry_path_offset_bytes_sha256);
      });
      it('viewing', () => checkViewing(reader.manifest, c.viewing));
      it('tables', async () => {
        for (const v of c.tables) checkTables(await reader.planeTables(v.plane), v);
      });
      for (const v of c.lists) it(`list at ${v.displayed_px} px, S_${v.scale}`, () => checkList(reader, v));
      it('plans', async () => {
        expect(new Set(c.plans.map((v: Json) => v.scale - v.wanted_scale)).size).toBeGreaterThan(1);
        for (const v of c.plans) if (v.policy === 'guard' || v.policy === 'thesis')
          await checkPlan(reader, v);
      });
      it('vertex splits', () => checkSplits(reader, c.split_stream ?? []));
      it('fragments', async () => {
        const rows = c.fragment_plane_rung_index_path_offset_bytes_sha256;
        for (const [plane, rung, fragment, path, offset, bytes, digest] of rows) {
          const range = await reader.fragmentRange(plane, rung, fragment);
          const entry = await reader.find(path);
          expect([entry.offset + range.offset, range.bytes]).toEqual([offset, bytes]);
          expect(path).toBe(t.rungPath(plane, rung));
          expect(t.toHex(await t.sha256(await reader.completeFragment(plane, rung, fragment)))).toBe(digest);
        }
      });
    });
}

const runners: Record<string, (cases: Json[]) => void | Promise<void>> = {
  'portable-math': runMath,
  throughput: runThroughput,
  proxies: runProxies,
  'harmonic-time': runPlan,
  packages: runPackages,
};
// A load of the browser client spends what is left of the time by spendBytes(): upgrades in order are the C++
// client's.
const files =
  readdirSync(join(root, 'delivery/vectors')).filter((f) => f.endsWith('.json') && f !== 'upgrades.json');

it('every file of vectors has a runner', () => {
  expect(files.map((f) => f.replace('.json', '')).sort()).toEqual(Object.keys(runners).sort());
});
for (const file of files)
  describe(file, async () => {
    await runners[file.replace('.json', '')]?.(JSON.parse(readText(`delivery/vectors/${file}`)).cases);
  });
