/** Light or dark: the system's theme until a person chooses one. */

const kKey = 'texmesh-theme';
const system = matchMedia('(prefers-color-scheme: dark)');
const listeners = new Set<() => void>();

function stored(): string | null {
  try {
    return localStorage.getItem(kKey);
  } catch {
    return null; // storage may be forbidden
  }
}

/** Colours that were read: reading one makes the page work out its styles. */
const known = new Map<string, string>();

function apply(theme = stored() ?? (system.matches ? 'dark' : 'light')): void {
  document.documentElement.dataset['theme'] = theme;
  known.clear();
  for (const f of listeners) f();
}

export function startTheme(): void {
  system.addEventListener('change', () => apply());
  apply();
}

export function toggleTheme(): void {
  const next = document.documentElement.dataset['theme'] === 'dark' ? 'light' : 'dark';
  try {
    localStorage.setItem(kKey, next);
  } catch {
    // the choice holds for this page alone
  }
  apply(next);
}

/** Calls `f` after every change of the theme. */
export function onTheme(f: () => void): void {
  listeners.add(f);
}

/** A colour of style.css, by the name of its variable. */
export function colour(name: string): string {
  let value = known.get(name);
  if (value === undefined) known.set(name,
    (value = getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim()));
  return value;
}
