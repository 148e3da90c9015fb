// The socket of a study's page. What is sent counts once the server has acknowledged it; until then it is sent again.

const RETRY = 1500; // milliseconds

export class StudySocket {
  /** onShown: called with what the page shows. onNote: with a text for the person. onState: whether it is connected. */
  constructor({ onShown, onNote, onState }) {
    Object.assign(this, { onShown, onNote, onState });
    this.waiting = new Map(); // messages without an acknowledgement, by number
    this.number = Math.floor(Math.random() * 1e9);
    this.open();
  }

  open() {
    const address = new URL("socket", document.baseURI);
    address.protocol = address.protocol.replace("http", "ws");
    this.socket = new WebSocket(address, ["deixis"]);
    this.socket.onopen = () => {
      this.onState(true);
      for (const message of this.waiting.values()) this.socket.send(message);
    };
    this.socket.onmessage = (event) => {
      const { shown, acknowledged, note } = JSON.parse(event.data);
      if (acknowledged !== undefined) {
        this.waiting.delete(acknowledged);
        this.onNote(note);
      }
      if (shown) this.onShown(shown);
    };
    this.socket.onclose = () => {
      this.onState(false);
      setTimeout(() => this.open(), RETRY);
    };
  }

  send(action, fields = {}) {
    const number = ++this.number;
    const message = JSON.stringify({ do: action, number, ...fields });
    this.waiting.set(number, message);
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(message);
  }
}
