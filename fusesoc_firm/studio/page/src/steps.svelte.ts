// The steps of a first visit, and those of them that this browser has done.

export const STEPS = {
  change: ["change something", "Connect two blocks, add one, or set a property."],
  simulate: ["simulate", "The stimuli of the project run through the system."],
  bitstream: ["bitstream for a board", "Choose a board that the system fits, build, and load."],
} as const;

export type Step = keyof typeof STEPS;

const ALL = Object.keys(STEPS) as Step[];
// A cookie is kept for all ports. Storage belongs to one of them, and each server has another one.
const NAME = "firm_steps";

class Steps {
  done = $state.raw<string[]>(document.cookie.match(`(?:^|; )${NAME}=([^;]*)`)?.[1].split(".") ?? []);
  isShown = $state(true);
  /** The step that comes next. */
  next = $derived(ALL.find((step) => !this.done.includes(step)));

  constructor() {
    this.isShown = this.next !== undefined;
  }

  finish(step: Step) {
    if (!this.done.includes(step)) this.#keep([...this.done, step]);
  }

  close() {
    this.isShown = false;
    this.#keep(ALL);
  }

  #keep(done: string[]) {
    this.done = done;
    document.cookie = `${NAME}=${done.join(".")}; path=/; max-age=31536000; samesite=strict`;
  }
}

export const steps = new Steps();
