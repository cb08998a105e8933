// @ts-check
// Scene documents: merge patches as the server applies them, defaults from the schema, short forms.

/** @typedef {import("./protocol.js").Json} Json */
/** @typedef {import("./protocol.js").JsonObject} JsonObject */
/** @typedef {import("./protocol.js").Schema} Schema */

/** @param {unknown} value @returns {value is JsonObject} */
export function isObject(value) {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

/** @param {Json | undefined} a @param {Json | undefined} b @returns {boolean} */
export function equal(a, b) {
  if (a === b) return true;
  if (Array.isArray(a) && Array.isArray(b)) return a.length === b.length && a.every((item, i) => equal(item, b[i]));
  if (!isObject(a) || !isObject(b)) return false;
  const keys = Object.keys(a);
  return keys.length === Object.keys(b).length && keys.every((key) => key in b && equal(a[key], b[key]));
}

/**
 * `target` with `patch` applied (RFC 7396); a patch that changes an object's `type` starts the object anew.
 * @param {Json | undefined} target @param {Json} patch @returns {Json}
 */
export function mergePatch(target, patch) {
  if (!isObject(patch)) return patch;
  const anew = !isObject(target) || ("type" in patch && "type" in target && patch.type !== target.type);
  /** @type {JsonObject} */
  const merged = anew ? {} : { ...target };
  for (const [key, value] of Object.entries(patch)) {
    if (value === null) delete merged[key];
    else merged[key] = mergePatch(merged[key], value);
  }
  return merged;
}

/** The schema of the values in a collection, or null. @param {Schema} schema @returns {Schema | null} */
export function entrySchema(schema) {
  return isObject(schema.additionalProperties) ? /** @type {Schema} */ (schema.additionalProperties) : null;
}

/**
 * The alternative that a tagged object follows, or the schema itself where there is no choice.
 * @param {Schema} schema @param {Json | undefined} value @returns {Schema}
 */
export function variantOf(schema, value) {
  if (!schema.oneOf) return schema;
  const tag = isObject(value) ? value.type : isObject(schema.default) ? schema.default.type : undefined;
  return schema.oneOf.find((variant) => variant.properties?.type?.const === tag) ?? schema.oneOf[0] ?? schema;
}

/**
 * `value` with every missing key filled in.
 * @param {Schema} schema @param {Json | undefined} value @returns {Json}
 */
export function complete(schema, value) {
  const given = value ?? schema.default ?? schema.const ?? null;
  const entries = entrySchema(schema);
  if (entries) {
    const kept = Object.entries(isObject(given) ? given : {}).filter(([, entry]) => entry !== null);
    return Object.fromEntries(kept.map(([name, entry]) => [name, complete(entries, entry)]));
  }
  const { properties } = variantOf(schema, given);
  if (!properties) return typeof given === "object" ? structuredClone(given) : given;
  const object = isObject(given) ? given : {};
  const known = Object.entries(properties).map(([key, child]) => [key, complete(child, object[key])]);
  return { ...object, ...Object.fromEntries(known) };
}

/**
 * The shortest document that [`complete`] turns back into `value`; a tag always stays.
 * @param {Schema} schema @param {Json} value @returns {Json}
 */
export function compact(schema, value) {
  if (!isObject(value)) return value;
  const entries = entrySchema(schema);
  if (entries) return Object.fromEntries(Object.entries(value).map(([name, entry]) => [name, compact(entries, entry)]));
  const { properties } = variantOf(schema, value);
  if (!properties) return value;
  /** @type {JsonObject} */
  const short = {};
  for (const [key, item] of Object.entries(value)) {
    const child = properties[key];
    if (!child || "const" in child) short[key] = item;
    else if (!equal(item, complete(child, undefined))) short[key] = compact(child, item);
  }
  return short;
}

/** @param {Json | undefined} document @param {string[]} path @returns {Json | undefined} */
export function valueAt(document, path) {
  /** @type {Json | undefined} */
  let value = document;
  for (const key of path) value = isObject(value) ? value[key] : undefined;
  return value;
}

/** The merge patch that sets one value. @param {string[]} path @param {Json} value @returns {JsonObject} */
export function patchFor(path, value) {
  const patch = path.reduceRight((/** @type {Json} */ inner, key) => ({ [key]: inner }), value);
  return isObject(patch) ? patch : {};
}

/** One patch that does what `first` and then `second` do. @param {JsonObject} first @param {JsonObject} second @returns {JsonObject} */
export function joinPatches(first, second) {
  const joined = { ...first };
  for (const [key, value] of Object.entries(second)) {
    const before = joined[key];
    joined[key] = isObject(before) && isObject(value) ? joinPatches(before, value) : value;
  }
  return joined;
}

/**
 * A scene with every key, from any document; what is missing has its default.
 * @param {Schema} schema @param {unknown} document @returns {import("./protocol.js").Scene}
 */
export function completeScene(schema, document) {
  return /** @type {any} */ (complete(schema, /** @type {Json} */ (document)));
}

/**
 * The scene after a patch.
 * @param {Schema} schema @param {import("./protocol.js").Scene} scene @param {JsonObject} patch
 */
export function patchScene(schema, scene, patch) {
  return completeScene(schema, mergePatch(/** @type {any} */ (scene), patch));
}

/**
 * The short document that a link or a file carries. It always names its volumes: without them a
 * document would stand for the default preset.
 * @param {Schema} schema @param {import("./protocol.js").Scene} scene @returns {JsonObject}
 */
export function compactScene(schema, scene) {
  const short = compact(schema, /** @type {any} */ (scene));
  return { ...(isObject(short) ? short : {}), volumes: isObject(short) && short.volumes ? short.volumes : {} };
}
