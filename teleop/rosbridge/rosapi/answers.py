"""Each service of rosapi as in ROS 1: its type, and its answer by the inspector's queries.

Names, and fields of requests and answers, are rosapi's.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, Iterable, Mapping
from typing import Any, TypeVar

import msgspec
from msgspec import Struct

from robots.shared import wire
from robots.shared.link.flood_limits import TokenBucket
from robots.shared.messages.type_names import bare
from robots.shared.sentences import say
from robots.shared.wire import NotDone, Refusal, Refused, TopicName, TypeName
from teleop.rosbridge.rosapi.typedefs import typedefs

PREFIX = "/rosapi/"
FRESH_S = 1.0  # a client asks for the type of each topic, one after the other: one list answers all
MOST_AT_ONCE = 4  # queries of one client
QUERIES_PER_S, QUERIES_BURST = 20.0, 100.0
ROS = {"version": 1, "distro": "noetic"}

_OTHER_ANSWER = Refusal("inspector_fault", "The inspector failed at this; its log says how.", "robot")

_TOO_OFTEN = Refusal("busy", "Too many questions about the robot: ask more slowly.", "limits")

Answer = dict[str, Any]
Query = wire.TopicQuery | wire.DoorQuery
_decode = msgspec.json.Decoder(wire.DoorAnswer).decode
S = TypeVar("S", bound=Struct)


class Rosapi:
    """rosapi for one connection. `query` asks the inspector, `change` sets or deletes a parameter; both raise NotDone.

    `own` returns further services that this connection may call, with their types; `own_actions` further actions.
    """

    def __init__(
        self,
        query: Callable[[Query], Awaitable[str]],
        change: Callable[[wire.SetParameter | wire.DeleteParameter], Awaitable[str]],
        own: Callable[[], Mapping[str, str]],
        own_actions: Callable[[], Iterable[str]],
    ) -> None:
        self._query = query
        self._change = change
        self._own = own
        self._own_actions = own_actions
        self._graph: tuple[float, asyncio.Future[wire.Graph]] | None = None
        self._room = asyncio.Semaphore(MOST_AT_ONCE)  # the inspector answers other people, too
        self._budget = TokenBucket(QUERIES_PER_S, QUERIES_BURST)

    async def call(self, service: str, args: Mapping[str, Any]) -> Answer:
        """Return the answer of `service`, one of `SERVICES`. Raises NotDone."""
        answer: Callable[[Rosapi, Mapping[str, Any]], Awaitable[Answer]] = SERVICES[service][1]
        return await answer(self, args)

    # --- topics, nodes, services ----------------------------------------------------------------------

    async def topics(self, _: Mapping[str, Any]) -> Answer:
        rows = (await self.graph()).topics
        return {"topics": [row.name for row in rows], "types": [_type(row) for row in rows]}

    async def topics_for_type(self, args: Mapping[str, Any]) -> Answer:
        rows = (await self.graph()).topics
        return {"topics": [row.name for row in rows if bare(row.type) == bare(str(args.get("type") or ""))]}

    async def topics_and_raw_types(self, _: Mapping[str, Any]) -> Answer:
        found = await self.topics({})
        texts = (await self.ask(wire.ListDefinitions(), wire.Definitions)).texts
        return {**found, "typedefs_full_text": [texts.get(type_, "") for type_ in found["types"]]}

    async def topic_type(self, args: Mapping[str, Any]) -> Answer:
        return {"type": _type(await self._topic(args))}

    async def publishers(self, args: Mapping[str, Any]) -> Answer:
        return {"publishers": (await self._topic(args)).publishers}

    async def subscribers(self, args: Mapping[str, Any]) -> Answer:
        return {"subscribers": (await self._topic(args)).subscribers}

    async def nodes(self, _: Mapping[str, Any]) -> Answer:
        return {"nodes": sorted(_nodes(await self.graph()))}

    async def node_details(self, args: Mapping[str, Any]) -> Answer:
        graph, node = await self.graph(), args.get("node")
        return {
            "subscribing": [row.name for row in graph.topics if node in row.subscribers],
            "publishing": [row.name for row in graph.topics if node in row.publishers],
            "services": [row.name for row in graph.services if node == row.node],
        }

    async def services(self, _: Mapping[str, Any]) -> Answer:
        return {"services": sorted({*(row.name for row in (await self.graph()).services), *self._console})}

    async def services_for_type(self, args: Mapping[str, Any]) -> Answer:
        types = (await self.ask(wire.ListServiceTypes(), wire.ServiceTypes)).types | self._console
        return {"services": sorted(name for name, type_ in types.items() if type_ == args.get("type"))}

    async def service_providers(self, args: Mapping[str, Any]) -> Answer:
        found = await self.services_for_type({"type": args.get("service")})
        nodes = {row.name: row.node for row in (await self.graph()).services}
        return {"providers": sorted({nodes[name] for name in found["services"] if name in nodes})}

    async def service_type(self, args: Mapping[str, Any]) -> Answer:
        name = _name(args, "service")
        if name in self._console:
            return {"type": self._console[name]}
        types = (await self.ask(wire.ListServiceTypes([name]), wire.ServiceTypes)).types
        return {"type": types.get(name, "")}

    async def service_node(self, args: Mapping[str, Any]) -> Answer:
        name = _name(args, "service")
        rows = (await self.graph()).services
        return {"node": next((row.node for row in rows if row.name == name), "")}

    async def service_host(self, args: Mapping[str, Any]) -> Answer:
        return {"host": (await self.ask(wire.LocateService(_name(args, "service")), wire.ServiceHost)).host}

    async def action_servers(self, _: Mapping[str, Any]) -> Answer:
        robots = (row.name for row in (await self.graph()).actions)
        return {"action_servers": sorted({*robots, *self._own_actions()})}

    # --- definitions ----------------------------------------------------------------------------------

    async def message_details(self, args: Mapping[str, Any]) -> Answer:
        return await self._typedefs(wire.Describe(_type_name(args)))

    async def service_request_details(self, args: Mapping[str, Any]) -> Answer:
        return await self._typedefs(wire.DescribeServiceType(_type_name(args)))

    async def service_response_details(self, args: Mapping[str, Any]) -> Answer:
        return await self._typedefs(wire.DescribeServiceType(_type_name(args), response=True))

    # --- parameters, time -----------------------------------------------------------------------------

    async def get_param(self, args: Mapping[str, Any]) -> Answer:
        try:
            found = await self.ask(wire.GetParameter(_name(args, "name"), whole=True), wire.Parameter)
        except NotDone as refused:
            if refused.refusal.code != "no_parameter":
                raise
            return {"value": args.get("default") or "null"}
        return {"value": msgspec.json.encode(found.value).decode()}

    async def set_param(self, args: Mapping[str, Any]) -> Answer:
        try:
            value = msgspec.json.decode(args.get("value", ""))
            change = wire.SetParameter(_name(args, "name"), value)
        except (msgspec.DecodeError, ValueError, TypeError) as error:
            text = say('The value of a parameter is JSON: a text such as "true" or "[1, 2]".')
            raise NotDone(Refusal("invalid", text, "wire")) from error
        answered(await self._change(change), wire.Parameter)
        return {}

    async def delete_param(self, args: Mapping[str, Any]) -> Answer:
        answered(await self._change(wire.DeleteParameter(_name(args, "name"))), wire.Parameter)
        return {}

    async def has_param(self, args: Mapping[str, Any]) -> Answer:
        name = _name(args, "name")
        names = await self._parameters()
        return {"exists": any(one == name or one.startswith(f"{name}/") for one in names)}

    async def search_param(self, args: Mapping[str, Any]) -> Answer:
        name = _name(args, "name")
        return {"global_name": name if name in await self._parameters() else ""}

    async def get_param_names(self, _: Mapping[str, Any]) -> Answer:
        return {"names": await self._parameters()}

    async def get_time(self, _: Mapping[str, Any]) -> Answer:
        now = await self.ask(wire.GetTime(), wire.RobotTime)
        return {"time": {"secs": now.secs, "nsecs": now.nsecs}}

    async def get_ros_version(self, _: Mapping[str, Any]) -> Answer:
        return dict(ROS)

    # --- questions ------------------------------------------------------------------------------------

    async def ask(self, query: Query, answer: type[S]) -> S:
        """Ask the inspector, a few questions at once. Raises NotDone."""
        if not self._budget.spend(time.monotonic()):
            raise NotDone(_TOO_OFTEN)
        async with self._room:
            return answered(await self._query(query), answer)

    async def graph(self) -> wire.Graph:
        """Return the robot's topics, actions and services, at most `FRESH_S` old. Raises NotDone."""
        if self._graph is None or time.monotonic() - self._graph[0] > FRESH_S:
            self._graph = time.monotonic(), asyncio.ensure_future(self.ask(wire.ListTopics(), wire.Graph))
        asked = self._graph
        try:
            return await asyncio.shield(asked[1])
        except NotDone:
            if self._graph is asked:
                self._graph = None
            raise

    async def _topic(self, args: Mapping[str, Any]) -> wire.TopicRow:
        name = _name(args, "topic")
        rows = (await self.graph()).topics
        return next((row for row in rows if row.name == name), wire.TopicRow(name, ""))

    async def _parameters(self) -> list[str]:
        return (await self.ask(wire.ListParameters(), wire.Parameters)).names

    async def _typedefs(self, query: wire.Describe | wire.DescribeServiceType) -> Answer:
        return {"typedefs": typedefs(await self.ask(query, wire.Described))}

    @property
    def _console(self) -> dict[str, str]:
        """The services of the console, with their types."""
        return {name: type_ for name, (type_, _) in SERVICES.items()} | dict(self._own())


def answered(raw: str, answer: type[S]) -> S:
    """Decode the inspector's answer. Raises NotDone if it refused."""
    found = _decode(raw)
    if isinstance(found, Refused):
        raise NotDone(found.refusal)
    if not isinstance(found, answer):
        raise NotDone(_OTHER_ANSWER)
    return found


def _name(args: Mapping[str, Any], field: str) -> str:
    """Return a name of the request, with its slash. Raises NotDone."""
    return _valid(f"/{str(args.get(field) or '').lstrip('/')}", TopicName)


def _type_name(args: Mapping[str, Any]) -> str:
    """Return the type of the request; ROS 2 clients write a/msg/B for a/B. Raises NotDone."""
    package, _, name = str(args.get("type") or "").partition("/")
    return _valid(f"{package}/{name.removeprefix('msg/').removeprefix('srv/')}", TypeName)


def _valid(name: str, kind: Any) -> str:
    try:
        return msgspec.convert(name, kind, strict=True)  # type: ignore[no-any-return]
    except msgspec.ValidationError as error:
        raise NotDone(
            Refusal("invalid", say("{name} is no name in ROS.", name=name[:200]), "wire")
        ) from error


def _type(row: wire.TopicRow) -> str:
    return "" if row.type == "*" else row.type


def _nodes(graph: wire.Graph) -> Iterable[str]:
    users = {node for row in graph.topics for node in (*row.publishers, *row.subscribers)}
    return users | {row.node for row in graph.services}


_TYPES = {  # by method
    "topics": "Topics",
    "topics_for_type": "TopicsForType",
    "topics_and_raw_types": "TopicsAndRawTypes",
    "topic_type": "TopicType",
    "publishers": "Publishers",
    "subscribers": "Subscribers",
    "nodes": "Nodes",
    "node_details": "NodeDetails",
    "services": "Services",
    "services_for_type": "ServicesForType",
    "service_providers": "ServiceProviders",
    "service_type": "ServiceType",
    "service_node": "ServiceNode",
    "service_host": "ServiceHost",
    "action_servers": "GetActionServers",
    "message_details": "MessageDetails",
    "service_request_details": "ServiceRequestDetails",
    "service_response_details": "ServiceResponseDetails",
    "get_param": "GetParam",
    "set_param": "SetParam",
    "delete_param": "DeleteParam",
    "has_param": "HasParam",
    "search_param": "SearchParam",
    "get_param_names": "GetParamNames",
    "get_time": "GetTime",
    "get_ros_version": "GetROSVersion",
}
# By name: type, and method that answers
SERVICES = {
    f"{PREFIX}{method}": (f"rosapi/{type_}", getattr(Rosapi, method)) for method, type_ in _TYPES.items()
}
