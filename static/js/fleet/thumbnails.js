/**
 * The newest picture of each robot's first camera on its card, a few times a minute. The card of a robot with
 * a camera keeps free space while there is no picture: cards that grow and shrink would move their buttons
 * away from a finger.
 */

import { CameraSocket } from "../camera/camera_socket.js";
import { fits } from "../camera/frame.js";
import { paintScale, scaleText } from "../camera/scale.js";
import { socketUrl } from "../connection/socket.js";

const RATE_HZ = 0.2; // at this rate the robot sends single pictures and no video

function empty(canvas) {
  canvas.getContext("2d").clearRect(0, 0, canvas.width, canvas.height);
}

export class Thumbnails {
  #sockets = [];

  /** @param {ParentNode} root with a canvas `data-thumbnail` for each robot, named by its slug */
  constructor(root) {
    for (const canvas of root.querySelectorAll("[data-thumbnail]")) this.#show(canvas);
  }

  close() {
    for (const socket of this.#sockets) socket.close();
  }

  #show(canvas) {
    const url = socketUrl(`/ws/robots/${canvas.dataset.thumbnail}/camera/`);
    const socket = new CameraSocket(url, Promise.resolve(false), RATE_HZ);
    this.#sockets.push(socket);
    let watched = null;
    socket.addEventListener("cameras", ({ detail: [first] }) => {
      if (watched && watched !== first?.name) socket.end(watched);
      watched = first?.name;
      canvas.hidden = !first;
      if (first) socket.watch(first.name, "small");
      else socket.close();
    });
    socket.addEventListener("picture", ({ detail }) => this.#paint(canvas, socket, detail));
    socket.addEventListener("state", ({ detail }) => {
      if (detail.refusal) empty(canvas);
    });
    socket.addEventListener("down", () => empty(canvas));
    socket.open();
  }

  async #paint(canvas, socket, { header, bytes }) {
    try {
      if (!fits(header)) throw new RangeError("no picture of this size is shown");
      const picture = await createImageBitmap(new Blob([bytes]));
      canvas.width = picture.width;
      canvas.height = picture.height;
      const pen = canvas.getContext("2d");
      pen.drawImage(picture, 0, 0);
      canvas.title = scaleText(header.scale);
      paintScale(pen, canvas.title, picture.width, picture.height);
      picture.close();
      socket.acknowledge(header, false);
    } catch {
      socket.acknowledge(header, true); // the next picture may be undamaged
    }
  }
}
