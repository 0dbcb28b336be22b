{% autoescape off %}// Without a connection, show the offline page. No other page is kept, because an old state of a robot would mislead.
const OFFLINE = [{% for file in files %}"{{ file|escapejs }}"{% if not forloop.last %}, {% endif %}{% endfor %}];
const ICON = "{{ icon|escapejs }}";
const CACHE = OFFLINE.join(" "); // changed files get a new cache
{% endautoescape %}
self.addEventListener("install", (event) => {
  self.skipWaiting();
  event.waitUntil(
    caches.open(CACHE).then((cache) =>
      cache.addAll(OFFLINE.map((file) => new Request(file, { cache: "reload" }))),
    ),
  );
});

self.addEventListener("activate", (event) => {
  event.waitUntil(
    caches
      .keys()
      .then((names) => Promise.all(names.filter((name) => name !== CACHE).map((name) => caches.delete(name))))
      .then(() => self.clients.claim()),
  );
});

// Always ask the network first. Forms, such as a stop, are not touched.
self.addEventListener("fetch", (event) => {
  const { request } = event;
  if (request.method !== "GET") return;
  const page = request.mode === "navigate";
  const file = OFFLINE.includes(new URL(request.url).pathname);
  if (!page && !file) return;
  event.respondWith(fetch(request).catch(() => caches.match(page ? OFFLINE[0] : request.url)));
});

// A notification of the console, encrypted for this browser.
self.addEventListener("push", (event) => {
  const { title, body, path, tag } = event.data.json();
  const shown = { body, tag, icon: ICON, data: { path } };
  event.waitUntil(self.registration.showNotification(title, shown));
});

// Show the page of the notification: an open one, else a new one.
self.addEventListener("notificationclick", (event) => {
  event.notification.close();
  const address = new URL(event.notification.data.path, self.location.origin).href;
  event.waitUntil(
    self.clients.matchAll({ type: "window", includeUncontrolled: true }).then((pages) => {
      const open = pages.find((page) => page.url === address);
      return open ? open.focus() : self.clients.openWindow(address);
    }),
  );
});
