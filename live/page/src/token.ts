// Who has the address that the program printed may command; the token stands in its fragment, which no server ever sees.

const key = 'crosstie-token';
let held = '';

function remember(token: string): void {
  held = token;
  try {
    if (token) sessionStorage.setItem(key, token);
    else sessionStorage.removeItem(key);
  } catch {
    // A browser that stores nothing: the token lives as long as the page.
  }
}

/** Takes the token out of the address line; true if one stood there. */
export function takeToken(): boolean {
  const fragment = location.hash.slice(1);
  if (location.hash || location.href.endsWith('#')) history.replaceState(null, '', location.pathname + location.search);
  if (!/^[\w.~-]+$/.test(fragment)) return false;
  remember(fragment);
  return true;
}

export function recallToken(): void {
  try {
    held = sessionStorage.getItem(key) ?? '';
  } catch {
    held = '';
  }
}

export const token = (): string => held;
export const forgetToken = (): void => remember('');
