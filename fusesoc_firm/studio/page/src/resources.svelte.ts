// The synthesis that the page has asked for; it goes on while another view is shown, and ends with the page.

import { address } from "./api";

/** What a block takes; see fusesoc_firm/exploration/resources.py. */
export interface Resources {
  name: string;
  lut: number;
  ff: number;
  ram: number;
  dsp: number;
  mhz: number | null;
}

interface News {
  step: "turn" | "netlist" | "cells" | "places" | "done" | "failed";
  device?: string;
  blocks?: Resources[];
  clocks?: Record<string, number>;
  /** The clocks in MHz that the specification names: by block, or "" for all others. */
  wanted?: Record<string, number>;
  missing?: string;
  reason?: string;
}

class Synthesis {
  /** The file and the version of its text that was asked for. */
  file = $state("");
  version = $state("");
  news = $state.raw<News | null>(null);
  isBusy = $state(false);
  start = 0;
  #socket: WebSocket | null = null;

  begin(file: string, version: string) {
    this.stop();
    [this.file, this.version, this.news, this.isBusy, this.start] = [file, version, { step: "turn" }, true, Date.now()];
    const socket = (this.#socket = new WebSocket(address("resources", { file })));
    socket.onmessage = (event) => {
      this.news = JSON.parse(event.data);
      if (this.news!.step === "done" || this.news!.step === "failed") this.stop();
    };
    socket.onclose = () => {
      if (this.#socket !== socket) return;
      this.news = { step: "failed", reason: "the server has ended the synthesis" };
      this.stop();
    };
  }

  /** End the synthesis; what is known stays. */
  stop() {
    const socket = this.#socket;
    [this.#socket, this.isBusy] = [null, false];
    socket?.close();
  }
}

export const synthesis = new Synthesis();
