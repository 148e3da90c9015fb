// The socket of a study's page. What is sent counts once the server has acknowledged it; until then it is sent again.

import { Socket } from "./socket.js";

export class StudySocket extends Socket {
  /** onShown: called with what the page shows. onNote: with a text for the person. onState: whether it is connected. */
  constructor({ onShown, onNote, onState }) {
    super("socket", ({ shown, acknowledged, note }) => {
      if (acknowledged !== undefined) {
        this.waiting.delete(acknowledged);
        onNote(note);
      }
      if (shown) onShown(shown);
    }, (connected) => {
      onState(connected);
      if (connected) for (const message of this.waiting.values()) super.send(...message);
    });
    this.waiting = new Map(); // messages without an acknowledgement, by number
    this.number = Math.floor(Math.random() * 1e9);
  }

  send(action, fields = {}) {
    const number = ++this.number;
    const message = [action, { number, ...fields }];
    this.waiting.set(number, message);
    super.send(...message);
  }
}
