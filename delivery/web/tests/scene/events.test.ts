import { expect, it } from 'vitest';
import { Emitter } from '../../src/scene/events';

it('a listener that throws does not keep others from hearing', () => {
  const events = new Emitter<{ done: { at: number } }>();
  const heard: number[] = [];
  const error = console.error;
  console.error = () => undefined;
  events.on('done', () => {
    throw new Error('mine');
  });
  const off = events.on('done', ({ at }) => heard.push(at));
  events.emit('done', {});
  off();
  events.emit('done', {});
  console.error = error;
  expect(heard.length).toBe(1);
});
