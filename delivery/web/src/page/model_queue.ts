import { type PageModel } from './page_model';
import { byInterest } from './schedule';

/** What a page does next. */
export type Step =
  | { what: 'open'; model: PageModel }
  | { what: 'turn'; model: PageModel; among: PageModel[] }
  | { what: 'refine'; model: PageModel }
  | { what: 'release'; model: PageModel };

/** Nothing is prepared beforehand where more of the memory is taken: it would be released at once. */
const mostBeforehand = 0.8;

/** What a decision needs to know of the page. */
export interface Situation {
  models: readonly PageModel[];
  /** Packages whose first bytes may come at once. */
  openAtOnce: number;
  /** Models that wait for their turn, and the model that is being refined. */
  askedForTurn: ReadonlySet<PageModel>;
  refining?: PageModel;
  /** Bytes on the GPU, as a share of what may be there. */
  memoryShare: number;
  /** On the screen or close to it. */
  isNear(model: PageModel): boolean;
}

/**
 * The next step, if there is one now: all first pictures of what is seen, then each of these its turn, then
 * first pictures close by, then more of what is seen. What is far from the screen is released first of all,
 * what nobody sees where the memory is full.
 */
export function nextStep({ models, openAtOnce, askedForTurn, refining, memoryShare,
    isNear: isNearby }: Situation): Step | undefined {
  const inOrder = [...models].sort((a, b) => byInterest(a.place, b.place));
  const isNear = (m: PageModel): boolean => m.place.areaPx > 0 && isNearby(m);
  const far = inOrder.find((m) => m.load && !m.place.visible && !isNear(m));
  if (far) return { what: 'release', model: far };
  const unseen = memoryShare > 1 && [...inOrder].reverse().find((m) => m.load && !m.place.visible);
  if (unseen) return { what: 'release', model: unseen };
  const opening = inOrder.filter((m) => m.phase === 'opening');
  const toOpen = (m: PageModel): boolean => m.phase === 'waiting' || m.phase === 'released';
  const seen = inOrder.filter((m) => m.place.visible);
  const closed = seen.find(toOpen);
  if (closed)
    return opening.filter((m) => m.coming).length < openAtOnce ? { what: 'open', model: closed } : undefined;
  if (opening.some((m) => m.place.visible) || inOrder.some((m) => m.phase === 'turn')) return undefined;
  const among = seen.filter((m) => askedForTurn.has(m));
  if (among.length > 0) return { what: 'turn', model: among[0], among };
  if (refining || opening.length > 0) return undefined;
  const unrefined = seen.find((m) => m.phase === 'shown' && !m.complete);
  const closeBy = memoryShare < mostBeforehand ? inOrder.find((m) => toOpen(m) && isNear(m)) : undefined;
  if (unrefined?.place.regarded || (unrefined && !closeBy)) return { what: 'refine', model: unrefined };
  return closeBy && { what: 'open', model: closeBy };
}
