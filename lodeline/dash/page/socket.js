// The line to the gateway: opens it again by itself, confirms each frame, carries the token.

const RETRY_MS = [250, 500, 1000, 2000];
const SILENCE_MS = 5000;

export class Line {
  constructor(handlers) {
    this.handlers = handlers;
    this.tries = 0;
    this.token = takeToken();
    this.open();
  }

  open() {
    const socket = new WebSocket(`ws://${location.host}/ws`);
    this.socket = socket;
    socket.onopen = () => {
      socket.send(JSON.stringify({ do: "hello", token: this.token }));
      this.watch();
    };
    socket.onmessage = (event) => {
      const said = JSON.parse(event.data);
      this.tries = 0; // not before: one that is turned away was let in first
      this.watch();
      if (said.t === "frame") this.send({ ack: said.n });
      this.handlers[said.t]?.(said);
    };
    socket.onclose = (event) => {
      clearTimeout(this.silence);
      this.handlers.closed(event.reason);
      const wait = RETRY_MS[Math.min(this.tries, RETRY_MS.length - 1)];
      this.tries += 1;
      setTimeout(() => this.open(), wait);
    };
  }

  // While a pipeline runs there is a frame 20 times a second; a line that is silent is dead.
  watch() {
    clearTimeout(this.silence);
    this.silence = setTimeout(() => {
      if (this.handlers.expecting()) this.socket.close();
      else this.watch();
    }, SILENCE_MS);
  }

  send(message) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }
}

// The token comes behind the # of the link; it is kept for this tab and taken out of the address.
function takeToken() {
  const given = new URLSearchParams(location.hash.slice(1)).get("token");
  if (given) {
    sessionStorage.setItem("token", given);
    history.replaceState(null, "", location.pathname);
  }
  return sessionStorage.getItem("token") || "";
}
