/** Listeners by name; one that throws does not keep the others from hearing. */
export class Emitter<Events> {
  private readonly listeners_ = new Set<[name: keyof Events, listener: (event: never) => void]>();

  on<K extends keyof Events>(name: K, listener: (event: Events[K]) => void): () => void {
    const entry: [K, (event: never) => void] = [name, listener];
    this.listeners_.add(entry);
    return () => this.listeners_.delete(entry);
  }
  /** Every event gets the time. */
  emit<K extends keyof Events>(name: K, event: Omit<Events[K], 'at'>): void {
    for (const [listenedTo, listener] of this.listeners_)
      try {
        if (listenedTo === name) listener({ ...event, at: performance.now() } as never);
      } catch (error) {
        console.error(error);
      }
  }
  clear(): void {
    this.listeners_.clear();
  }
}
