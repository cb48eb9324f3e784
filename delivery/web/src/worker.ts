import { handle, packError } from './worker/handle';
import type { WorkerAnswer, WorkerRequest } from './worker/protocol';

export { handle, packError };
/** What pages without workers decode documents by. */
export * from './format/documents';

interface WorkerScope {
  onmessage: ((event: { data: WorkerRequest & { id: number } }) => void) | null;
  postMessage(answer: WorkerAnswer, transfer: Transferable[]): void;
}
const scope = globalThis as unknown as WorkerScope & { WorkerGlobalScope?: unknown };
if (typeof scope.WorkerGlobalScope !== 'undefined')
  scope.onmessage = ({ data }) => {
    handle(data).then(([result, transfer]) => scope.postMessage({ id: data.id, result }, transfer),
      (error: unknown) => scope.postMessage({ id: data.id, error: packError(error) }, []));
  };
