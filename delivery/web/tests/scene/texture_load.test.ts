import { expect, it } from 'vitest';
import { fakeServer } from '../support/fake_server';
import { loading, until } from '../support/loading';
import { files, url } from '../support/scan';

it('who gives up an override in the timed part does not ask for everything', async () => {
  const server = fakeServer(files);
  const l = await loading(url, server, { rung: 0, time: 5, autoRefine: false });
  expect(await until(() => l.pkg.requests.some((q) => q.kind === 'texture'))).toBe(true);
  l.model.setOverride({});
  let inTime = -1;
  l.model.on('deadline', () => (inTime = Math.max(...l.model.state.planes.flatMap((p) => [...p.rungs]))));
  await l.model.done;
  expect(inTime).toBe(0);
  l.dispose();
});

it('planes with more texels take the time that is left where all that was chosen has come', async () => {
  const shown: number[][] = [];
  const l =
    await loading(url, fakeServer(files), { time: 3, beta0BytesS: 6000, display: 2000, autoRefine: false });
  l.model.on('plane', ({ base, widthPx }) => (shown[base] ??= []).push(widthPx));
  await l.model.done;
  expect(l.count('deadline')).toBe(1);
  expect(shown.some((px) => px.length > 1)).toBe(true);
  for (const px of shown) expect(px).toEqual([...new Set(px)].sort((a, b) => a - b)); // never fewer texels
  const at = (name: string): number[] => l.events.flatMap((e, i) => (e.name === name ? [i] : []));
  expect(Math.max(...at('plane'))).toBeLessThan(at('deadline')[0]);
  // of the last plane some came, too
  expect(Math.max(...at('fragment'))).toBeGreaterThan(Math.max(...at('plane')));
  expect(l.count('error')).toBe(0);
  l.dispose();
});
