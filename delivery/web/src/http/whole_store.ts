import { FormatError } from '../format/errors';
import { bootstrapBytes } from '../format/layout';
import { ByteRange, manifestOfContainer } from '../format/manifest';
import type { PackageStore, Place, ReadOptions } from './store';

/** A container in memory. */
class WholeStore implements PackageStore {
  readonly form = 'whole';
  constructor(
    private bytes_: Uint8Array,
    readonly name: string,
  ) {}
  manifest(): Promise<Uint8Array> {
    return Promise.resolve(manifestOfContainer(this.bytes_.subarray(0, bootstrapBytes), this.name));
  }
  async read(place: Place, { offset, bytes }: ByteRange, how: ReadOptions): Promise<Uint8Array> {
    if (offset + bytes > this.bytes_.length)
      throw new FormatError(this.name, place.path, `${offset + bytes} bytes`, `${this.bytes_.length}`, 'K01');
    const part = this.bytes_.subarray(offset, offset + bytes);
    await how.verify?.(part);
    return part;
  }
  dispose(): void {
    this.bytes_ = new Uint8Array(0);
  }
}

/** A container that is in memory already. */
export function openBytes(bytes: Uint8Array, name: string): PackageStore {
  return new WholeStore(bytes, name);
}
