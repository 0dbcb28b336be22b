{% autoescape off %}// Without a connection it shows the page that says so. It keeps no other page: what a robot does is never old news.
const OFFLINE = [{% for file in files %}"{{ file|escapejs }}"{% if not forloop.last %}, {% endif %}{% endfor %}];
const CACHE = OFFLINE.join(" "); // other files, other cache
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

// The network first, always. A form, and with it a stop, passes untouched.
self.addEventListener("fetch", (event) => {
  const { request } = event;
  if (request.method !== "GET") return;
  const page = request.mode === "navigate";
  const file = OFFLINE.includes(new URL(request.url).pathname);
  if (!page && !file) return;
  event.respondWith(fetch(request).catch(() => caches.match(page ? OFFLINE[0] : request.url)));
});
