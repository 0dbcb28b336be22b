/** A fake of the browser's WebSocket. `made` has all fake sockets since the last `FakeSocket.begin()`. */

export let made = [];

export class FakeSocket extends EventTarget {
  static OPEN = 1;
  readyState = 0;
  bufferedAmount = 0;
  sent = [];

  static begin() {
    made = [];
  }

  constructor(url) {
    super();
    this.url = url;
    made.push(this);
  }

  opens() {
    this.readyState = 1;
    this.dispatchEvent(new Event("open"));
  }

  says(text) {
    this.dispatchEvent(Object.assign(new Event("message"), { data: text }));
  }

  send(text) {
    this.sent.push(JSON.parse(text));
  }

  close(code = 1006) {
    this.readyState = 3;
    this.dispatchEvent(Object.assign(new Event("close"), { code }));
  }
}
