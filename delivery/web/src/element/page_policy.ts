// What a page's Content-Security-Policy forbids, and what it wants to be told.

/** What the policy has forbidden so far, as the browser names it: "worker-src blob". */
export const forbidden = new Set<string>();
globalThis.document?.addEventListener('securitypolicyviolation', (event) => {
  if (event.disposition === 'enforce') forbidden.add(`${event.effectiveDirective} ${event.blockedURI}`);
});
/** Workers from text, as the decoder of meshes is one. */
export const forbidsTextWorkers = (): boolean => forbidden.has('worker-src blob');

interface Trusted {
  createScriptURL(url: string): string;
  createHTML(text: string): string;
}
let policy: Trusted | undefined;
/** Makes texts trusted for pages that want it so (`require-trusted-types-for 'script'`). */
export function trusted(what: keyof Trusted, text: string): string {
  const given = (value: string): string => value;
  const { trustedTypes: types } =
    globalThis as { trustedTypes?: { createPolicy(name: string, rules: Trusted): Trusted } };
  try {
    policy ??= types?.createPolicy('texmesh', { createScriptURL: given, createHTML: given });
  } catch {
    // its list of policies has no `texmesh`
  }
  return policy ? policy[what](text) : text;
}
