// Parameters of addresses and requests.

/** Appends the entries of an object to a URLSearchParams. Empty values are left out, arrays repeat their key. */
export function append(query, params) {
  for (const [key, value] of Object.entries(params)) {
    for (const one of Array.isArray(value) ? value : [value]) {
      if (one !== undefined && one !== null && one !== "") query.append(key, one);
    }
  }
  return query;
}
