import { describe, expect, it } from "vitest";
import { DelayEchoes, RoundTrips } from "../../../static/js/connection/round_trips.js";

describe("round trips", () => {
  it("are shown as a median, so that one slow trip is hidden", () => {
    const trips = new RoundTrips();
    expect(trips.median).toBeNull();
    for (const trip of [8, 9, 400, 10, 8]) trips.add(trip);
    expect(trips.median).toBe(9);
  });

  it("are measured from a number's sending to its first echo", () => {
    const echoes = new DelayEchoes();
    echoes.sent(1, 100);
    echoes.sent(2, 130);
    expect(echoes.receive(2, 150)).toBe(20);
    expect(echoes.receive(2, 180)).toBeNull();
    expect(echoes.receive(1, 190)).toBeNull(); // a later number has already come back
    expect(echoes.receive(null, 200)).toBeNull();
  });
});
