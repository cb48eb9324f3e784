/** format/rules.txt and the schemas of documents, put into the bundle by rule_data.mjs. */
declare module 'texmesh-rules' {
  export const rules: string;
  export const schemas: Record<string, unknown>;
}
