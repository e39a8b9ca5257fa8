import type { State } from './state';

const silenceMs = 15000;  // the program sends a sign of life every 5 s
const waitsMs = [500, 1000, 2000, 4000, 8000];

export interface LinkEvents {
  state(state: State): void;
  open(): void;
  /** Lost, and tried again after so many seconds. */
  lost(why: string, seconds: number): void;
}

/** Server-sent events by hand: an EventSource shows neither the signs of life nor the status of a refusal. */
export class Link {
  private failures = 0;
  private wake: (() => void) | undefined;

  constructor(private readonly events: LinkEvents) {
    addEventListener('online', () => this.wake?.());
    document.addEventListener('visibilitychange', () => {
      if (!document.hidden) this.wake?.();
    });
  }

  async run(): Promise<never> {
    for (;;) {
      const why = await this.listen();
      const wait = waitsMs[Math.min(this.failures++, waitsMs.length - 1)]!;
      this.events.lost(why, wait / 1000);
      await new Promise<void>((resolve) => {
        const timer = setTimeout(resolve, wait);
        this.wake = () => {
          clearTimeout(timer);
          resolve();
        };
      });
      this.wake = undefined;
    }
  }

  /** Until the connection ends; says why. */
  private async listen(): Promise<string> {
    const stop = new AbortController();
    let watch = setTimeout(() => stop.abort(), silenceMs);
    try {
      const answer = await fetch('/events', { headers: { Accept: 'text/event-stream' }, cache: 'no-store', signal: stop.signal });
      if (answer.status === 503) return 'Too many windows show this page: close one.';
      if (!answer.ok || !answer.body) return `The program refused the connection (${answer.status}).`;
      this.failures = 0;
      this.events.open();
      const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
      let rest = '';
      for (;;) {
        const { done, value } = await reader.read();
        if (done) return 'The program closed the connection.';
        clearTimeout(watch);
        watch = setTimeout(() => stop.abort(), silenceMs);
        const parts = (rest + value).split(/\r?\n\r?\n/);
        rest = parts.pop() ?? '';
        this.newest(parts);
      }
    } catch {
      return stop.signal.aborted ? 'The program has been silent for 15 s.' : 'The program does not answer.';
    } finally {
      clearTimeout(watch);
      stop.abort();
    }
  }

  /** Of several states that came together only the last is worth showing. */
  private newest(parts: string[]): void {
    for (const part of parts.reverse()) {
      const lines = part.split(/\r?\n/);
      if (!lines.some((line) => /^event: ?state$/.test(line))) continue;
      const data = lines.filter((line) => line.startsWith('data:')).map((line) => line.slice(5).replace(/^ /, ''));
      try {
        this.events.state(JSON.parse(data.join('\n')) as State);
      } catch {
        continue;
      }
      return;
    }
  }
}
