/** Round trips of the last seconds. */

const KEPT = 7;

export class RoundTrips {
  #kept = [];

  add(milliseconds) {
    if (!(milliseconds >= 0)) return;
    this.#kept.push(milliseconds);
    if (this.#kept.length > KEPT) this.#kept.shift();
  }

  clear() {
    this.#kept = [];
  }

  /** The median, in milliseconds; null before the first. */
  get median() {
    if (this.#kept.length === 0) return null;
    const sorted = [...this.#kept].sort((a, b) => a - b);
    return sorted[Math.floor(sorted.length / 2)];
  }
}

/** The time at which each numbered message was sent, until the robot's bridge echoes the number. */
export class DelayEchoes {
  #sent = new Map();

  /** Return the socket, except that the number of every message is stored. */
  counted(socket) {
    return {
      send: (message) => {
        this.sent(message.seq, performance.now());
        return socket.send(message);
      },
      takeBacklog: () => socket.takeBacklog(),
    };
  }

  sent(seq, nowMs) {
    this.#sent.set(seq, nowMs);
    if (this.#sent.size > 200) this.#sent.delete(this.#sent.keys().next().value);
  }

  /** @returns {number | null} milliseconds since that number was sent; null if unknown or already used */
  receive(seq, nowMs) {
    const at = this.#sent.get(seq);
    if (at === undefined) return null;
    for (const older of this.#sent.keys()) {
      if (older <= seq) this.#sent.delete(older);
    }
    return nowMs - at;
  }
}
