import { type LoadOptions, type Manifest, isMetallic } from 'texmesh';
import type { Choices } from '../choices';
import type { Stage } from '../stage/stage';
import { gltfLoader } from './decoders';

/** Options of every load on a stage. */
export function stageOptions(stage: Stage,
    signal: AbortSignal): Pick<LoadOptions, 'renderer' | 'gltfLoader' | 'camera' | 'signal'> {
  const loader = (): ReturnType<typeof gltfLoader> => gltfLoader(({ scene }) => {
    // A mesh is seen here before its programs are made; the programs depend on the surroundings.
    if (isMetallic(scene)) stage.reflect();
  });
  return { renderer: stage.renderer, gltfLoader: loader, camera: stage.camera, signal };
}

/** The package's scale nearest to a number, which may come from an address written for another package. */
export function nearestScale(manifest: Manifest | null, wanted: number | null): number | undefined {
  const scales = manifest?.scales.map((s) => s.scale) ?? [];
  if (wanted === null || scales.length === 0) return undefined;
  return scales.reduce((best, s) => (Math.abs(s - wanted) < Math.abs(best - wanted) ? s : best));
}

/** What a person has chosen of scale and rung; undefined: the library chooses. */
export function chosenDetail(manifest: Manifest | null,
    choices: Choices): Pick<LoadOptions, 'scale' | 'rung'> {
  return { scale: nearestScale(manifest, choices.scale), rung: choices.rung ?? undefined };
}
