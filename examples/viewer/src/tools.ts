import type { Comparison } from './comparison';
import { byId } from './dom';
import type { Stage } from './stage/stage';
import { toggleTheme } from './theme';

/** Buttons over the picture, and their keys. */
export function wireTools(stage: Stage, comparison: Comparison): void {
  const togglePanel = (): void => {
    const wide = document.body.classList.toggle('wide');
    byId('toggle').setAttribute('aria-expanded', String(!wide));
  };
  byId('home').addEventListener('click', () => stage.home());
  byId('theme').addEventListener('click', toggleTheme);
  byId('toggle').addEventListener('click', togglePanel);
  byId('toggle').setAttribute('aria-expanded', String(!document.body.classList.contains('wide')));
  document.addEventListener('keydown', (e) => {
    if (e.ctrlKey || e.metaKey || e.altKey ||
        /^(INPUT|SELECT|TEXTAREA)$/.test((e.target as HTMLElement).tagName)) return;
    const action =
      { s: () => comparison.toggle(), t: toggleTheme, p: togglePanel, '0': () => stage.home() }[e.key];
    action?.();
  });
}
