import { describe, expect, it } from 'vitest';
import { type Situation, nextStep } from '../../src/page/model_queue';
import type { PageModel } from '../../src/page/page_model';

type Fake = Pick<PageModel, 'phase' | 'place' | 'complete' | 'coming'> & { load?: object; near?: boolean };
const model = (phase: PageModel['phase'],
    more: Partial<Fake> & { visible?: boolean; areaPx?: number; regarded?: boolean } = {}): Fake => {
  const { visible = true, areaPx = 100, regarded = false, ...rest } = more;
  const load = ['first-picture', 'turn', 'shown'].includes(phase) ? {} : undefined;
  return { phase, load, complete: false, coming: phase === 'opening', near: visible,
    place: { visible, regarded, areaPx, distancePx: 0 }, ...rest };
};
const step = (models: Fake[], more: Partial<Situation> = {}): string => {
  const askedForTurn =
    new Set(models.filter((m) => m.phase === 'first-picture')) as unknown as Set<PageModel>;
  const situation = { openAtOnce: 2, memoryShare: 0, askedForTurn, isNear: (m: unknown) => !!(m as Fake).near,
    ...more };
  const next = nextStep({ ...situation, models: models as unknown as PageModel[] });
  return next ? `${next.what} ${models.indexOf(next.model as unknown as Fake)}` : 'nothing';
};

describe('a page', () => {
  it('opens what is seen first, the largest first, so many at once', () => {
    expect(step([])).toBe('nothing');
    expect(step([model('waiting'), model('waiting', { areaPx: 200 }),
      model('waiting', { visible: false, near: true, areaPx: 900 })])).toBe('open 1');
    expect(step([model('waiting'), model('opening'), model('opening')])).toBe('nothing');
    // bytes that have come leave the link to others
    expect(step([model('waiting'), model('opening'), model('opening', { coming: false })])).toBe('open 0');
    expect(step([model('waiting', { visible: false, near: false })])).toBe('nothing');
  });
  it('gives turns once all that is seen has its first picture, one after the other', () => {
    expect(step([model('first-picture'), model('opening')])).toBe('nothing');
    expect(step([model('first-picture'), model('first-picture', { areaPx: 300 })])).toBe('turn 1');
    expect(step([model('first-picture'), model('turn')])).toBe('nothing');
    expect(step([model('first-picture', { visible: false, near: true })])).toBe('nothing');
    // one that failed keeps nobody waiting
    expect(step([model('first-picture'), model('failed')])).toBe('turn 0');
  });
  it('opens what is close by before it refines, but for what the user looks at', () => {
    const close = model('waiting', { visible: false, near: true });
    expect(step([model('shown'), close])).toBe('open 1');
    expect(step([model('shown', { regarded: true }), close])).toBe('refine 0');
    expect(step([model('shown')])).toBe('refine 0');
    expect(step([model('shown', { complete: true })])).toBe('nothing');
    const busy = model('shown');
    expect(step([busy, model('shown')], { refining: busy as unknown as PageModel })).toBe('nothing');
  });
  it('releases what is far from the screen, and opens it again', () => {
    expect(step([model('shown', { visible: false, near: false }), model('waiting')])).toBe('release 0');
    expect(step([model('turn', { visible: false, near: false })])).toBe('release 0');
    expect(step([model('released', { visible: false, near: true })])).toBe('open 0');
    expect(step([model('released', { visible: false, near: false })])).toBe('nothing');
  });
  it('releases what nobody sees where the memory is full, the least of it first, and prepares nothing then',
      () => {
    const near = (areaPx: number): Fake => model('shown', { visible: false, near: true, areaPx });
    expect(step([near(100), near(50), model('shown')], { memoryShare: 1.1 })).toBe('release 1');
    expect(step([model('shown', { complete: true })], { memoryShare: 1.1 })).toBe('nothing');
    expect(step([model('shown', { complete: true }), model('released', { visible: false, near: true })],
      { memoryShare: 0.9 })).toBe('nothing');
    expect(step([model('shown', { complete: true }), model('released', { visible: false, near: true })],
      { memoryShare: 0.7 })).toBe('open 1');
  });
});
