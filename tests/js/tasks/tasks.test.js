import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { PANELS } from "../../../static/js/control/panels/list.js";
import { shortened, TaskRequests } from "../../../static/js/tasks/tasks.js";

const KINDS = Object.assign({}, ...PANELS.map(({ requests }) => requests));

describe("tasks", () => {
  let sent;
  let notices;
  let requests;
  let open;

  beforeEach(() => {
    vi.useFakeTimers();
    sent = [];
    notices = [];
    open = true;
    const send = (message) => open && sent.push(message) > 0;
    requests = new TaskRequests(send, (notice) => notices.push(notice), 100, KINDS);
    requests.fence = 7;
  });
  afterEach(() => {
    requests.close();
    vi.useRealTimers();
  });

  it("carry this tab's fence, and a number each", () => {
    requests.send({ t: "play", motion: "wave", title: "Wave" });
    requests.send({ t: "refresh" });
    expect(sent).toEqual([
      { t: "play", motion: "wave", seq: 101, fence: 7 },
      { t: "refresh", seq: 102 },
    ]);
  });

  it("without control are not sent, and say what to do", async () => {
    requests.fence = null;
    expect((await requests.send({ t: "play", motion: "wave" })).code).toBe("no_lease");
    expect(sent).toEqual([]);
    expect(notices[0].text).toBe("Play wave: Take control first.");
  });

  it("to a silent robot are not sent, because they would come late; those that end something are", async () => {
    const ending = Object.keys(KINDS).filter((t) => /_(cancel|stop)$/.test(t));
    const beginning = Object.keys(KINDS).filter((t) => !KINDS[t].control && !ending.includes(t));
    document.body.dataset.stale = "true";
    requests.stale = true;
    requests.send({ t: "play", motion: "wave" });
    expect(sent.pop().t).toBe("play"); // a hiccup of the network
    vi.advanceTimersByTime(1100);
    notices.length = 0;
    for (const t of beginning)
      expect((await requests.send({ t, use: "speech", text: "" })).code).toBe("robot_silent");
    expect(notices[0].text).toContain("No contact");
    for (const t of ending) requests.send({ t });
    expect(sent.map(({ t }) => t)).toEqual(ending);
    delete document.body.dataset.stale;
  });

  it("to cancel without control carry no fence", () => {
    requests.fence = null;
    requests.send({ t: "play_cancel" });
    expect(sent).toEqual([{ t: "play_cancel", seq: 101 }]);
  });

  it("report only a refusal when repeated quietly", () => {
    requests.send({ t: "publish", topic: "/key_vel", quiet: true });
    requests.send({ t: "publish", topic: "/key_vel", quiet: true });
    expect(sent[0]).toEqual({ t: "publish", topic: "/key_vel", seq: 101, fence: 7 });
    requests.receive({ t: "accepted", of: "publish", seq: 101 });
    expect(notices).toEqual([]);
    const refusal = { code: "stopped", text: "The robot is stopped." };
    requests.receive({ t: "refused", of: "publish", seq: 102, refusal });
    expect(notices.length).toBe(1);
  });

  it("are reported once when accepted, with the effect", async () => {
    const answer = requests.send({ t: "look_ahead" });
    expect(requests.receive({ t: "accepted", of: "look_ahead", seq: 101 })).toBe(true);
    expect(await answer).toBeNull();
    expect(requests.receive({ t: "accepted", of: "look_ahead", seq: 101 })).toBe(false);
    expect(notices).toHaveLength(1);
    expect(notices[0]).toMatchObject({ level: "success" });
    vi.advanceTimersByTime(1000);
    expect(notices).toHaveLength(1);
  });

  it("are reported once when refused, with the reason", async () => {
    const answer = requests.send({ t: "play", motion: "wave", title: "Wave" });
    const refusal = { code: "motion_runs", text: "Ann has it perform bow.", rule: "robot" };
    requests.receive({ t: "refused", of: "play", seq: 101, refusal });
    expect(await answer).toBe(refusal);
    expect(notices).toEqual([
      {
        level: "warning",
        code: "Play Wave motion_runs",
        text: "Play Wave: Ann has it perform bow.",
      },
    ]);
  });

  it("share a notice only with repeats of the same task", () => {
    for (const topic of ["/say", null]) requests.send({ t: "choose", use: "speech", topic });
    for (const seq of [101, 102]) requests.receive({ t: "accepted", of: "choose", seq });
    requests.fence = null;
    for (const motion of ["wave", "bow"]) requests.send({ t: "play", motion });
    expect(new Set(notices.map(({ code }) => code)).size).toBe(4);
  });

  it("report a missing answer after 0.75 s, then a late one", async () => {
    const answer = requests.send({ t: "look_ahead" });
    vi.advanceTimersByTime(749);
    expect(notices).toEqual([]);
    vi.advanceTimersByTime(1);
    expect((await answer).code).toBe("no_answer");
    expect(notices[0].text).toContain("0.75 s");
    requests.receive({ t: "accepted", of: "look_ahead", seq: 101 });
    expect(notices[1].level).toBe("success");
  });

  it("report a missing answer once, also after a lost connection", () => {
    requests.send({ t: "look_ahead" });
    vi.advanceTimersByTime(4000);
    requests.lost();
    expect(notices).toHaveLength(1);
  });

  it("are refused without a connection, and when it is lost", async () => {
    const answer = requests.send({ t: "play", motion: "wave" });
    requests.lost();
    expect((await answer).code).toBe("no_answer");
    open = false;
    expect((await requests.send({ t: "play", motion: "wave" })).code).toBe("not_connected");
    expect(notices).toHaveLength(2);
  });

  it("leave the answers of others alone", () => {
    requests.send({ t: "play", motion: "wave" });
    const refusal = { code: "too_old", text: "", rule: "wire" };
    expect(requests.receive({ t: "refused", of: "drive", seq: 101, refusal })).toBe(false);
    expect(requests.receive({ t: "view" })).toBe(false);
  });

  it("name a long text by its beginning", () => {
    expect(shortened("one\ntwo")).toBe("one two");
    expect(shortened("x".repeat(50))).toHaveLength(40);
    expect(Array.from(shortened("🙂".repeat(50)))).toHaveLength(40);
  });
});
