"""The tables. A study version is frozen; participants hold trials; a trial has at most one response.

What must never happen twice is a unique key here, not a promise in the code: one seat an ordinal,
one meeting a (scene, motion), one response a trial.
"""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from sqlalchemy import (
    JSON,
    CheckConstraint,
    DateTime,
    ForeignKey,
    MetaData,
    String,
    UniqueConstraint,
)
from sqlalchemy.engine import Dialect
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column, relationship
from sqlalchemy.types import TypeDecorator

MODES = ("live", "pilot", "preview", "simulated")
OPEN_STATES = ("leased", "shown")
COUNTED_STATES = ("leased", "shown", "answered")


class UtcDateTime(TypeDecorator[datetime]):
    """A moment in UTC that stays aware on SQLite too, which itself forgets the zone."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """Refuse naive time, store UTC."""
        if value is None:
            return None
        if value.tzinfo is None:
            raise ValueError(f"naive time {value!r}: pass datetime.now(UTC)")
        return value.astimezone(UTC)

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """Give UTC back."""
        if value is None:
            return None
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)


class Base(DeclarativeBase):
    """Names every constraint by one scheme, so that migrations can find them on every database."""

    metadata = MetaData(
        naming_convention={
            "ix": "ix_%(table_name)s_%(column_0_N_name)s",
            "uq": "uq_%(table_name)s_%(column_0_N_name)s",
            "ck": "ck_%(table_name)s_%(constraint_name)s",
            "fk": "fk_%(table_name)s_%(column_0_N_name)s_%(referred_table_name)s",
            "pk": "pk_%(table_name)s",
        }
    )
    type_annotation_map = {  # noqa: RUF012  # SQLAlchemy reads it from the class
        datetime: UtcDateTime,
        dict[str, Any]: JSON,
        list[Any]: JSON,
    }


def _choice(column: str, values: tuple[str, ...]) -> CheckConstraint:
    listed = ", ".join(f"'{value}'" for value in values)
    return CheckConstraint(f"{column} IN ({listed})", name=column)


class Secret(Base):
    """Keys that this installation made for itself: cookie signing, platform identities."""

    __tablename__ = "secret"

    name: Mapped[str] = mapped_column(String(40), primary_key=True)
    value: Mapped[str] = mapped_column(String(200))


class StudyVersion(Base):
    """The frozen, hashed design of a study over one catalogue."""

    __tablename__ = "study_version"
    __table_args__ = (
        UniqueConstraint("study_id", "version"),
        _choice("state", ("draft", "open", "closed")),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    study_id: Mapped[str] = mapped_column(String(64), index=True)
    version: Mapped[str] = mapped_column(String(64))
    state: Mapped[str] = mapped_column(String(10), default="draft")
    open_mode: Mapped[str] = mapped_column(String(10), default="live")
    config: Mapped[dict[str, Any]]
    lists: Mapped[list[Any]]
    """Policy `list`: the prepared sessions; otherwise empty."""
    catalogue_folder: Mapped[str] = mapped_column(String(1000))
    catalogue_sha256: Mapped[str] = mapped_column(String(64))
    group_key: Mapped[str] = mapped_column(String(64))
    """Keys the opaque clip groups that simulated participants see in place of method names."""
    created_at: Mapped[datetime]
    opened_at: Mapped[datetime | None]
    closed_at: Mapped[datetime | None]
    enrolled: Mapped[int] = mapped_column(default=0)
    """Serial number of the last participant; seeds sessions reproducibly."""
    withdrawn: Mapped[int] = mapped_column(default=0)
    """All that remains of participants who withdrew."""

    cells: Mapped[list[Cell]] = relationship(order_by="Cell.id", back_populates="version")


class Cell(Base):
    """Scene x method pair; locked while a pair of it is handed out (PostgreSQL)."""

    __tablename__ = "cell"
    __table_args__ = (UniqueConstraint("version_id", "scene", "target", "baseline"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    version_id: Mapped[int] = mapped_column(ForeignKey("study_version.id"))
    scene: Mapped[str] = mapped_column(String(64))
    target: Mapped[str] = mapped_column(String(64))
    baseline: Mapped[str] = mapped_column(String(64))

    version: Mapped[StudyVersion] = relationship(back_populates="cells")


class ClipRow(Base):
    """A clip of the catalogue, as far as the study needs it."""

    __tablename__ = "clip"
    __table_args__ = (UniqueConstraint("version_id", "clip_id"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    version_id: Mapped[int] = mapped_column(ForeignKey("study_version.id"))
    clip_id: Mapped[str] = mapped_column(String(128))
    method: Mapped[str] = mapped_column(String(64))
    file: Mapped[str] = mapped_column(String(500))
    poster: Mapped[str] = mapped_column(String(500))
    sha256: Mapped[str] = mapped_column(String(64))
    duration_s: Mapped[float]
    width: Mapped[int]
    height: Mapped[int]


class Pair(Base):
    """Two clips of one scene and motion to be compared."""

    __tablename__ = "pair"
    __table_args__ = (
        UniqueConstraint("version_id", "kind", "target_clip_id", "baseline_clip_id"),
        _choice("kind", ("main", "catch", "identical", "practice")),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    version_id: Mapped[int] = mapped_column(ForeignKey("study_version.id"))
    kind: Mapped[str] = mapped_column(String(10))
    cell_id: Mapped[int | None] = mapped_column(ForeignKey("cell.id"), index=True)
    label: Mapped[str] = mapped_column(String(40))
    """`pair_id` of the export."""
    scene: Mapped[str] = mapped_column(String(64))
    motion: Mapped[str] = mapped_column(String(128))
    target_clip_id: Mapped[int] = mapped_column(ForeignKey("clip.id"))
    baseline_clip_id: Mapped[int] = mapped_column(ForeignKey("clip.id"))
    expected_method: Mapped[str | None] = mapped_column(String(64))

    target_clip: Mapped[ClipRow] = relationship(
        foreign_keys=[target_clip_id], lazy="joined", innerjoin=True
    )
    baseline_clip: Mapped[ClipRow] = relationship(
        foreign_keys=[baseline_clip_id], lazy="joined", innerjoin=True
    )

    @property
    def stimulus(self) -> str:
        """`scene|motion`, the stimulus cluster of the analysis."""
        return f"{self.scene}|{self.motion}"


class PairCount(Base):
    """How often a pair is under way or done in one mode, by side: a cache that `doctor` recounts."""

    __tablename__ = "pair_count"
    __table_args__ = (
        CheckConstraint("target_first >= 0 AND target_second >= 0", name="not_negative"),
        _choice("mode", MODES),
    )

    pair_id: Mapped[int] = mapped_column(ForeignKey("pair.id"), primary_key=True)
    mode: Mapped[str] = mapped_column(String(10), primary_key=True)
    target_first: Mapped[int] = mapped_column(default=0)
    target_second: Mapped[int] = mapped_column(default=0)


class Ticket(Base):
    """Permission to enrol simulated or preview participants; only its hash is kept."""

    __tablename__ = "ticket"
    __table_args__ = (_choice("mode", ("simulated", "preview")),)

    id: Mapped[int] = mapped_column(primary_key=True)
    version_id: Mapped[int] = mapped_column(ForeignKey("study_version.id"))
    token_hash: Mapped[str] = mapped_column(String(64), unique=True)
    mode: Mapped[str] = mapped_column(String(10))
    created_at: Mapped[datetime]


class Participant(Base):
    """One person's session; identified by a random code, entered by a token of which we keep the hash."""

    __tablename__ = "participant"
    __table_args__ = (
        UniqueConstraint("version_id", "code"),
        UniqueConstraint("version_id", "mode", "platform_hash"),
        _choice("mode", MODES),
        _choice("state", ("enrolled", "finished")),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    version_id: Mapped[int] = mapped_column(ForeignKey("study_version.id"), index=True)
    code: Mapped[str] = mapped_column(String(20))
    serial: Mapped[int]
    mode: Mapped[str] = mapped_column(String(10))
    state: Mapped[str] = mapped_column(String(10), default="enrolled")
    token_hash: Mapped[str] = mapped_column(String(64), unique=True)
    ticket_id: Mapped[int | None] = mapped_column(ForeignKey("ticket.id"))
    platform_hash: Mapped[str | None] = mapped_column(String(64))
    """Keyed hash of a recruiting platform's identity; worthless once the key is deleted."""
    enrolled_at: Mapped[datetime]
    consent_sha256: Mapped[str] = mapped_column(String(64))
    steps: Mapped[dict[str, Any]]
    """Pages done beside the trials: name -> what was entered or measured there."""
    seen_at: Mapped[datetime]
    finished_at: Mapped[datetime | None]
    completion_code: Mapped[str | None] = mapped_column(String(64))
    browser: Mapped[str] = mapped_column(String(40), default="unknown")
    """Family and device class only."""
    excluded: Mapped[bool] = mapped_column(default=False)
    """Excluded by the experimenter: the answers stay, the pairs are topped up by others."""

    version: Mapped[StudyVersion] = relationship(lazy="joined", innerjoin=True)
    trials: Mapped[list[Trial]] = relationship(
        order_by="Trial.ordinal", back_populates="participant", cascade="all, delete-orphan"
    )


class Trial(Base):
    """A seat in a session, and the pair bound to it just in time."""

    __tablename__ = "trial"
    __table_args__ = (
        UniqueConstraint("participant_id", "ordinal"),
        UniqueConstraint("participant_id", "exposure_key"),
        _choice("kind", ("main", "catch", "identical", "repeat", "practice")),
        _choice("state", ("planned", "leased", "shown", "answered", "expired", "void")),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    participant_id: Mapped[int] = mapped_column(ForeignKey("participant.id"), index=True)
    ordinal: Mapped[int]
    block: Mapped[int]
    kind: Mapped[str] = mapped_column(String(10))
    cell_id: Mapped[int | None] = mapped_column(ForeignKey("cell.id"))
    repeat_of: Mapped[int | None]
    state: Mapped[str] = mapped_column(String(10), default="planned")
    pair_id: Mapped[int | None] = mapped_column(ForeignKey("pair.id"), index=True)
    target_first: Mapped[bool | None]
    exposure_key: Mapped[str | None] = mapped_column(String(200))
    """`scene|motion` for main trials where no one may meet it twice; NULL escapes the unique key."""
    counted: Mapped[bool] = mapped_column(default=False)
    """Is this trial in the pair's counter now? Changed in the transaction that changes the counter."""
    token: Mapped[str | None] = mapped_column(String(64), unique=True)
    first_token: Mapped[str | None] = mapped_column(String(64), unique=True)
    second_token: Mapped[str | None] = mapped_column(String(64), unique=True)
    lease_expires_at: Mapped[datetime | None] = mapped_column(index=True)
    shown_at: Mapped[datetime | None]

    participant: Mapped[Participant] = relationship(back_populates="trials")
    pair: Mapped[Pair | None] = relationship()
    response: Mapped[Response | None] = relationship(
        back_populates="trial", cascade="all, delete-orphan"
    )
    events: Mapped[list[ViewingEvent]] = relationship(
        order_by="ViewingEvent.id", cascade="all, delete-orphan"
    )

    @property
    def first_clip(self) -> ClipRow:
        """The clip above or left."""
        assert self.pair is not None
        return self.pair.target_clip if self.target_first else self.pair.baseline_clip

    @property
    def second_clip(self) -> ClipRow:
        """The clip below or right."""
        assert self.pair is not None
        return self.pair.baseline_clip if self.target_first else self.pair.target_clip


class ViewingEvent(Base):
    """Something the page told about a clip, with the moment the server heard of it."""

    __tablename__ = "viewing_event"
    __table_args__ = (UniqueConstraint("trial_id", "uuid"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    trial_id: Mapped[int] = mapped_column(ForeignKey("trial.id"), index=True)
    uuid: Mapped[str] = mapped_column(String(36))
    kind: Mapped[str] = mapped_column(String(20))
    position: Mapped[str | None] = mapped_column(String(6))
    detail: Mapped[dict[str, Any]]
    received_at: Mapped[datetime]


class Response(Base):
    """The answer of a trial; the unique key on the trial makes a second one impossible."""

    __tablename__ = "response"
    __table_args__ = (
        _choice("chosen_position", ("first", "second")),
        _choice("viewed_first", ("proven", "unproven", "unknown")),
        _choice("viewed_second", ("proven", "unproven", "unknown")),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    trial_id: Mapped[int] = mapped_column(ForeignKey("trial.id"), unique=True)
    answer_uuid: Mapped[str] = mapped_column(String(36))
    chosen_position: Mapped[str] = mapped_column(String(6))
    response_time_ms: Mapped[int | None]
    decision_time_ms: Mapped[int | None]
    plays_first: Mapped[int | None]
    plays_second: Mapped[int | None]
    viewed_first: Mapped[str] = mapped_column(String(10))
    viewed_second: Mapped[str] = mapped_column(String(10))
    layout: Mapped[str | None] = mapped_column(String(12))
    screen: Mapped[dict[str, Any]]
    """Pixel sizes of window and clips, dropped frames: whatever the page could measure."""
    answered_at: Mapped[datetime]
    late: Mapped[bool] = mapped_column(default=False)

    trial: Mapped[Trial] = relationship(back_populates="response")


class AuditEntry(Base):
    """What an operator or a withdrawal did to a study; holds no participant data."""

    __tablename__ = "audit_entry"

    id: Mapped[int] = mapped_column(primary_key=True)
    version_id: Mapped[int] = mapped_column(ForeignKey("study_version.id"), index=True)
    at: Mapped[datetime]
    action: Mapped[str] = mapped_column(String(40))
    detail: Mapped[dict[str, Any]]
