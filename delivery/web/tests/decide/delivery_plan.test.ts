import { describe, expect, it } from 'vitest';
import { defaultDeliveryRequest, planDelivery } from '../../src/decide/delivery_plan';
import { setUp } from '../support/transferring';

describe('the scale', () => {
  it('is the wanted one when time is plenty, the coarsest when there is none', async () => {
    const { data } = await setUp();
    const at = (timeLimitS: number, scale = -1) => {
      const base = defaultDeliveryRequest();
      return planDelivery(data, { ...base, displayedPx: 1e6, timeLimitS, scale });
    };
    const coarsest = data.manifest.scales[data.manifest.scales.length - 1].scale;
    expect(at(1e3)).toMatchObject({ scale: 0, late: false });
    expect(at(1e-3)).toMatchObject({ scale: coarsest, late: true });
    expect(at(1e-3, 0)).toMatchObject({ scale: 0, late: true }); // as it was asked for
    expect(at(1e3, 98)).toBeUndefined();
  });
});
