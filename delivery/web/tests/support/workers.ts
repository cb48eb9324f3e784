/** Workers that do what a test says, instead of the browser's. */
export async function withWorkers<T extends object>(made: (number: number) => T,
    body: (all: T[]) => Promise<void>): Promise<void> {
  const all: T[] = [];
  const before = Object.getOwnPropertyDescriptor(globalThis, 'Worker');
  const value = function (): T {
    return all[all.push(made(all.length)) - 1];
  };
  Object.defineProperty(globalThis, 'Worker', { value, configurable: true });
  try {
    await body(all);
  } finally {
    if (before) Object.defineProperty(globalThis, 'Worker', before);
    else Reflect.deleteProperty(globalThis, 'Worker');
  }
}
