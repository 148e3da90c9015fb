// A socket of the page: messages come in as JSON, and go out with what they do. It connects again when it is closed.

const RETRY = 1500; // milliseconds

/** path: of the socket. onMessage: called with each message. onState: called with whether it is connected. */
export class Socket {
  constructor(path, onMessage, onState) {
    Object.assign(this, { path, onMessage, onState });
    this.open();
  }

  open() {
    const address = new URL(this.path, document.baseURI);
    address.protocol = address.protocol.replace("http", "ws");
    this.socket = new WebSocket(address, ["deixis"]);
    this.socket.onopen = () => this.onState(true);
    this.socket.onmessage = (event) => this.onMessage(JSON.parse(event.data));
    this.socket.onclose = () => {
      this.onState(false);
      setTimeout(() => this.open(), RETRY);
    };
  }

  send(action, fields = {}) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ do: action, ...fields }));
  }
}
