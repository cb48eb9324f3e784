/** Listeners by name; one that throws does not keep the others from hearing. */
export class Emitter<Events> {
  private readonly listeners_ = new Map<keyof Events, Set<(event: never) => void>>();

  on<K extends keyof Events>(name: K, listener: (event: Events[K]) => void): () => void {
    const set = this.listeners_.get(name) ?? new Set();
    this.listeners_.set(name, set.add(listener as (event: never) => void));
    return () => set.delete(listener as (event: never) => void);
  }
  /** Every event gets the time. */
  emit<K extends keyof Events>(name: K, event: Omit<Events[K], 'at'>): void {
    for (const listener of this.listeners_.get(name) ?? []) {
      try {
        listener({ ...event, at: performance.now() } as never);
      } catch (error) {
        console.error(error);
      }
    }
  }
  clear(): void {
    this.listeners_.clear();
  }
}
