import { requireRule } from './fields';
import { Value, shown } from './values';

/** The part of JSON Schema that schemas/ has. "x-rule": what a breach breaks, here and below. */
export interface Schema {
  $ref?: string;
  definitions?: Record<string, Schema>;
  'x-rule'?: string;
  type?: 'object' | 'array' | 'string' | 'boolean' | 'integer' | 'number';
  enum?: Value[];
  const?: Value;
  minItems?: number;
  maxItems?: number;
  minLength?: number;
  maxLength?: number;
  minimum?: number;
  maximum?: number;
  exclusiveMinimum?: number;
  multipleOf?: number;
  pattern?: string;
  items?: Schema | Schema[];
  properties?: Record<string, Schema>;
  required?: string[];
}

const isOf: Record<NonNullable<Schema['type']>, (value: Value) => boolean> = {
  object: (v) => v instanceof Map,
  array: Array.isArray,
  string: (v) => typeof v === 'string',
  boolean: (v) => typeof v === 'boolean',
  integer: Number.isInteger,
  number: (v) => typeof v === 'number',
};
/** Lengths count elements or bytes. */
function isInRange(value: Value, s: Schema): boolean {
  if (Array.isArray(value)) return value.length >= (s.minItems ?? 0) && value.length <= (s.maxItems ?? Infinity);
  if (typeof value === 'string') {
    const bytes = new TextEncoder().encode(value).length;
    return bytes >= (s.minLength ?? 0) && bytes <= (s.maxLength ?? Infinity) && (!s.pattern || new RegExp(s.pattern).test(value));
  }
  if (typeof value !== 'number') return true;
  const isWhole = s.multipleOf === undefined || value % s.multipleOf === 0;
  return isWhole && value > (s.exclusiveMinimum ?? -Infinity) && value >= (s.minimum ?? -Infinity) && value <= (s.maximum ?? Infinity);
}

/** A value of a document against its schema; FormatError by the nearest "x-rule". */
export function validate(value: Value, schema: Schema, what: string, above = 'J04', root = schema): void {
  if (schema.$ref) return validate(value, root.definitions![schema.$ref.split('/').at(-1)!], what, above, root);
  const rule = schema['x-rule'] ?? above;
  const allowed = schema.enum ?? (schema.const === undefined ? undefined : [schema.const]);
  const isTyped = !schema.type || isOf[schema.type](value);
  requireRule(isTyped && (!allowed || allowed.includes(value)), rule, what, `something else than ${shown(value)}`);
  if (schema.type) requireRule(isInRange(value, schema), rule, what, `something else than ${shown(value)}`);
  const { items, properties = {}, required = [] } = schema;
  if (Array.isArray(value) && items)
    value.forEach((v, k) => validate(v, Array.isArray(items) ? items[k] : items, `${what}[${k}]`, rule, root));
  if (!(value instanceof Map)) return;
  for (const [name, member] of Object.entries(properties)) {
    const v = value.get(name);
    requireRule(v !== undefined || !required.includes(name), 'J04', what, name);
    if (v !== undefined) validate(v, member, `${what}/${name}`, rule, root);
  }
}
