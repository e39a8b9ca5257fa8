import { byId, element, mark, say, show } from './dom';
import { forgetToken, token } from './token';

export type Command =
  | { command: 'next' | 'repeat' | 'undo' | 'finish' | 'cancel' | 'check' | 'reconnect' }
  | { command: 'stage'; name: string }
  | { command: 'select'; station: string }
  | { command: 'axis'; position_mm: number }
  | { command: 'exposure'; exposure_s: number; gain: number };

export const watchingOnly = 'watching only: open the address that the program printed';

// Gloves press twice: a second press so soon is the same press.
const bounceMs = 600;

/** One place for the answer to the last command; it stays until the next one is accepted. */
function answer(text: string): void {
  const box = byId('answer');
  if (!text) {
    show(box, false);
    box.replaceChildren();
    return;
  }
  const close = element('button', 'small', 'Close');
  close.type = 'button';
  close.addEventListener('click', () => answer(''));
  box.replaceChildren(element('p', 'grow', text), close);
  show(box, true);
}

async function refusal(response: Response): Promise<string> {
  try {
    const body = (await response.json()) as { error?: unknown };
    if (typeof body.error === 'string' && body.error) return body.error;
  } catch {
    // No JSON: the status has to do.
  }
  return `The program refused it (${response.status}).`;
}

/** Sends one command; true if it was accepted. Never throws: what went wrong is shown. */
export async function send(command: Command): Promise<boolean> {
  try {
    const response = await fetch('/command', {
      method: 'POST',
      headers: { 'Content-Type': 'application/json', 'X-Crosstie-Token': token() },
      body: JSON.stringify(command),
      cache: 'no-store',
      signal: AbortSignal.timeout(10000),
    });
    if (response.ok) {
      answer('');
      return true;
    }
    if (response.status === 401) {
      forgetToken();
      dispatchEvent(new Event('crosstie-token'));
      answer('The program was started anew and no longer knows this page. Open the address that it printed.');
    } else {
      answer(await refusal(response));
    }
  } catch {
    answer('The program did not answer. Nothing is known of the command: look at the state, then try again.');
  }
  return false;
}

/**
 * A button that is never disabled in the browser's sense: it keeps the focus when it may not be pressed for a while, and its
 * reason can be read. An empty reason: it may be pressed.
 */
export class CommandButton {
  readonly root = element('div', 'command');
  readonly button = element('button');
  private readonly why = element('span', 'why');
  private reason = 'not connected';
  private pressed = 0;

  constructor(
    id: string,
    private readonly label: string,
    private readonly make: () => Command | null,
    options: { key?: string; className?: string; hint?: string } = {},
  ) {
    this.button.type = 'button';
    this.button.id = id;
    this.button.className = options.className ?? '';
    this.why.id = `${id}-why`;
    this.button.append(element('span', 'label', label));
    if (options.key) {
      const hint = element('kbd', '', options.key);
      hint.setAttribute('aria-hidden', 'true');
      this.button.append(hint);
    }
    this.button.setAttribute('aria-describedby', this.why.id);
    this.root.append(this.button, this.why);
    this.button.addEventListener('click', () => this.press());
    this.button.addEventListener('keydown', (event) => {
      if (event.repeat && (event.key === 'Enter' || event.key === ' ')) event.preventDefault();
    });
    this.allow(this.reason);
  }

  allow(reason: string): void {
    this.reason = reason;
    mark(this.button, 'aria-disabled', reason ? 'true' : null);
    say(this.why, reason);
  }

  name(text: string): void {
    say(this.button.firstElementChild!, text);
  }

  press(): void {
    const now = performance.now();
    if (this.reason) {
      this.root.classList.remove('refused');
      requestAnimationFrame(() => this.root.classList.add('refused'));
      say(byId('spoken'), `${this.label}: ${this.reason}.`);
      return;
    }
    if (now - this.pressed < bounceMs) return;
    const command = this.make();
    if (!command) return;
    this.pressed = now;
    this.button.setAttribute('aria-busy', 'true');
    void send(command).finally(() => this.button.removeAttribute('aria-busy'));
  }
}
