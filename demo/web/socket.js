// The socket of this tab: sections of the page's state come in, messages go out.

const RETRY = 1500; // milliseconds

/** number: of this tab, which its scene has in its address too. */
export class Socket {
  constructor(number, onSections, onState) {
    this.number = number;
    this.onSections = onSections;
    this.onState = onState;
    this.open();
  }

  open() {
    const address = new URL(`socket/${this.number}`, document.baseURI);
    address.protocol = address.protocol.replace("http", "ws");
    this.socket = new WebSocket(address, ["deixis"]);
    this.socket.onopen = () => this.onState(true);
    this.socket.onmessage = (event) => this.onSections(JSON.parse(event.data));
    this.socket.onclose = () => {
      this.onState(false);
      setTimeout(() => this.open(), RETRY);
    };
  }

  send(action, fields = {}) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ do: action, ...fields }));
  }
}
