// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/aggregator/eventaggregator.hpp"

GST_DEBUG_CATEGORY_STATIC(event_aggregator_debug);
#define GST_CAT_DEFAULT event_aggregator_debug

using GstEventAggregatorPrivate = std::unique_ptr<EventAggregator>;

G_DEFINE_ABSTRACT_TYPE_WITH_CODE(GstEventAggregator, gst_event_aggregator, GST_TYPE_AGGREGATOR,
                                 G_ADD_PRIVATE(GstEventAggregator)
                                     GST_DEBUG_CATEGORY_INIT(event_aggregator_debug,
                                                             "eventaggregator", 0,
                                                             "aggregators of event streams"))
#define PARENT_AGGREGATOR_CLASS GST_AGGREGATOR_CLASS(gst_event_aggregator_parent_class)

EventAggregator::EventAggregator(GstAggregator* element, const Role& role)
    : element_(element),
      role_(role),
      main_pad_(role.main_pad != nullptr ? pad(role.main_pad) : nullptr),
      faults_(role.verb, GST_CAT_DEFAULT) {}

GstAggregatorPad* EventAggregator::pad(const char* name) const {
  GstPad* pad = gst_element_get_static_pad(GST_ELEMENT(element_), name);
  gst_object_unref(pad);  // the element keeps it alive
  return GST_AGGREGATOR_PAD(pad);
}

GstSegment segment_of(GstAggregatorPad* pad) {
  GST_OBJECT_LOCK(pad);
  GstSegment segment = pad->segment;
  GST_OBJECT_UNLOCK(pad);
  if (segment.format != GST_FORMAT_TIME) gst_segment_init(&segment, GST_FORMAT_TIME);
  return segment;
}

void EventAggregator::set_segment(const GstSegment& segment) {
  gst_aggregator_update_segment(element_, &segment);
  segment_sent_ = false;
}

GstFlowReturn EventAggregator::push(OwnedBuffer buffer) {
  if (is_gap(buffer.get()))
    return push_gap(GST_BUFFER_PTS(buffer.get()), GST_BUFFER_DURATION(buffer.get()));
  segment_sent_ = true;
  return gst_aggregator_finish_buffer(element_, buffer.release());
}

GstFlowReturn EventAggregator::push_gap(GstClockTime start, GstClockTime duration) {
  GstPad* const src = GST_AGGREGATOR_SRC_PAD(element_);
  if (segment_sent_) return push_event(src, gst_event_new_gap(start, duration));
  const OwnedCaps caps(gst_pad_get_current_caps(src));
  if (!caps || !sensor_of(caps.get())) return GST_FLOW_OK;
  // gst_aggregator_push_mandatory_events() sends the segment only before a buffer or EOS.
  OwnedBuffer empty(gst_buffer_new());
  GST_BUFFER_PTS(empty.get()) = start;
  GST_BUFFER_DURATION(empty.get()) = duration;
  GST_BUFFER_FLAG_SET(empty.get(), GST_BUFFER_FLAG_GAP | GST_BUFFER_FLAG_DISCONT);
  segment_sent_ = true;
  return gst_aggregator_finish_buffer(element_, empty.release());
}

std::optional<GstClockTime> running_time(GstAggregatorPad* pad, GstClockTime time) {
  const GstSegment segment = segment_of(pad);
  const guint64 running = gst_segment_to_running_time(&segment, GST_FORMAT_TIME, time);
  if (!GST_CLOCK_TIME_IS_VALID(running)) return std::nullopt;
  return running;
}

GstClockTime EventAggregator::next_time() {
  const auto buffer = next_buffer(main_pad_);
  if (!buffer) return has_ended(main_pad_) ? 0 : GST_CLOCK_TIME_NONE;
  if (!GST_BUFFER_PTS_IS_VALID(buffer.get())) return 0;
  return running_time(main_pad_, GST_BUFFER_PTS(buffer.get())).value_or(0);
}

/// Sends an event upstream from all sink pads. Returns true if all accept it.
static gboolean forward(GstAggregator* element, GstEvent* event) {
  bool handled = true;
  for_each_sink_pad(element, [&](GstAggregatorPad* pad) {
    handled &= gst_pad_push_event(GST_PAD(pad), gst_event_ref(event)) != FALSE;
  });
  gst_event_unref(event);
  return handled ? TRUE : FALSE;
}

/// Answers a caps query on a pad whose buffers pass through with the caps that downstream accepts.
static void answer_caps_of_passed(EventAggregator& self, GstAggregator* aggregator,
                                  GstAggregatorPad* pad, GstQuery* query) {
  GstCaps* filter = nullptr;
  gst_query_parse_caps(query, &filter);
  const OwnedCaps ours(gst_pad_get_pad_template_caps(GST_PAD(pad)));
  const OwnedCaps accepted(gst_pad_peer_query_caps(GST_AGGREGATOR_SRC_PAD(aggregator), ours.get()));
  OwnedCaps result = self.input_caps(
      OwnedCaps(gst_caps_intersect_full(accepted.get(), ours.get(), GST_CAPS_INTERSECT_FIRST)));
  if (filter != nullptr)
    result.reset(gst_caps_intersect_full(result.get(), filter, GST_CAPS_INTERSECT_FIRST));
  gst_query_set_caps_result(query, result.get());
}

struct EventAggregatorFunctions {
  static EventAggregator& of(GstAggregator* element) { return *gst_event_aggregator_impl(element); }

  /// True if the buffers of a pad pass through.
  static bool is_passed(const EventAggregator& self, GstAggregatorPad* pad) {
    return pad == self.main_pad_ && self.role_.passes_main_pad;
  }

  template <class Work>
  static auto guard(EventAggregator& self, const Work& work) {
    const auto report = [&self](const std::exception& error) -> Report {
      self.release_memory();
      return events_report(self.role_.verb)(error);
    };
    return catch_exceptions(self.element_, report, work);
  }

  static void forget_segment_ends(EventAggregator& self) {
    for_each_sink_pad(self.element_, forget_segment_end);
    self.segment_ended_ = false;
  }

  /// True if an event is forwarded in order with the buffers. gst_aggregator_default_sink_event()
  /// would forward it from any pad, before the segment, and drop tags.
  static bool is_passed_on(const EventAggregator& self, GstAggregatorPad* pad, GstEvent* event) {
    switch (GST_EVENT_TYPE(event)) {
      case GST_EVENT_TAG:
        return pad == self.main_pad_;
      case GST_EVENT_STREAM_START:
      case GST_EVENT_CAPS:
      case GST_EVENT_SEGMENT:
      case GST_EVENT_GAP:
      case GST_EVENT_EOS:
      case GST_EVENT_FLUSH_STOP:
        return false;
      default:
        return is_serialized(event);
    }
  }

  /// Forwards an event, once the segment is sent.
  static gboolean pass_on(EventAggregator& self, OwnedEvent event) {
    if (self.segment_sent_)
      return gst_pad_push_event(GST_AGGREGATOR_SRC_PAD(self.element_), event.release());
    self.waiting_.push_back(std::move(event));
    return TRUE;
  }

  static void send_waiting(EventAggregator& self) {
    for (auto& event : std::exchange(self.waiting_, {}))
      gst_pad_push_event(GST_AGGREGATOR_SRC_PAD(self.element_), event.release());
  }

  /// Sends waiting events between the segment and the first buffer or EOS: GstAggregator pushes the
  /// segment itself, in gst_aggregator_push_mandatory_events(), and has no virtual function there.
  static GstPadProbeReturn probe_output(GstPad*, GstPadProbeInfo* info, gpointer element) {
    const bool is_buffer = (GST_PAD_PROBE_INFO_TYPE(info) & GST_PAD_PROBE_TYPE_BUFFER) != 0;
    if (is_buffer || GST_EVENT_TYPE(GST_PAD_PROBE_INFO_EVENT(info)) == GST_EVENT_EOS)
      send_waiting(of(GST_AGGREGATOR(element)));
    return GST_PAD_PROBE_OK;
  }

  /// At the end of the output: EOS, or SEGMENT_DONE once all pads have reached the end of their
  /// segments.
  static GstFlowReturn end(EventAggregator& self) {
    const auto pads = sink_pads(self.element_);
    OwnedEvent done;
    const auto all_have_ended = [&] {
      return std::ranges::all_of(pads, [](const auto& pad) { return has_ended(pad.get()); });
    };
    if (self.main_pad_ != nullptr)
      done = segment_end_of(self.main_pad_);
    else if (all_have_ended())  // otherwise downstream has returned EOS
      for (const auto& pad : pads)
        if (auto end = segment_end_of(pad.get())) done = std::move(end);
    if (!done) return GST_FLOW_EOS;
    self.segment_ended_ = true;
    for (const auto& pad : pads)
      while (next_buffer(pad.get())) gst_aggregator_pad_drop_buffer(pad.get());
    if (!all_have_ended()) return GST_AGGREGATOR_FLOW_NEED_DATA;
    GST_DEBUG_OBJECT(self.element_, "the segment of all inputs has ended");
    for (const auto& pad : pads) gst_aggregator_pad_drop_buffer(pad.get());
    auto* const src = GST_AGGREGATOR_PAD(GST_AGGREGATOR_SRC_PAD(self.element_));
    if (!self.segment_sent_) {  // since no buffer was
      const GstSegment segment = segment_of(src);
      GstEvent* const event = gst_event_new_segment(&segment);
      gst_event_set_seqnum(event, gst_event_get_seqnum(done.get()));
      gst_pad_push_event(GST_PAD(src), event);
      send_waiting(self);
    }
    flush(self.element_);
    gst_pad_push_event(GST_PAD(src), done.release());
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  }

  static GstFlowReturn aggregate(GstAggregator* element, gboolean timed_out) {
    auto& self = of(element);
    if (timed_out) GST_LOG_OBJECT(element, "deadline passed; continuing without further input");
    return guard(self, [&] {
      const auto result = self.segment_ended_ ? GST_FLOW_EOS : self.aggregate(timed_out != FALSE);
      return result == GST_FLOW_EOS ? end(self) : result;
    });
  }

  static GstClockTime get_next_time(GstAggregator* element) {
    auto& self = of(element);
    return self.segment_ended_ ? GST_CLOCK_TIME_NONE
                               : guard(self, [&] { return self.next_time(); });
  }

  static GstFlowReturn update_src_caps(GstAggregator* element, GstCaps*, GstCaps** result) {
    const auto& caps = of(element).main_caps_;
    if (!caps) return GST_AGGREGATOR_FLOW_NEED_DATA;
    *result = gst_caps_ref(caps.get());
    return GST_FLOW_OK;
  }

  static bool handle_caps(EventAggregator& self, GstAggregatorPad* pad, GstEvent* event) {
    GstCaps* const caps = caps_of(event);
    if (!self.handle_caps(pad, caps)) {
      GST_ERROR_OBJECT(pad, "cannot %s %" GST_PTR_FORMAT, self.role_.verb, caps);
      return false;
    }
    GST_DEBUG_OBJECT(pad, "accepted %" GST_PTR_FORMAT, caps);
    if (is_passed(self, pad)) {
      self.main_caps_ = self.output_caps(caps);
      gst_pad_mark_reconfigure(GST_AGGREGATOR_SRC_PAD(self.element_));
    }
    return true;
  }

  static void handle_segment(EventAggregator& self, GstAggregatorPad* pad,
                             const GstSegment& segment) {
    GST_DEBUG_OBJECT(pad, "%" GST_SEGMENT_FORMAT, &segment);
    if (pad != self.main_pad_) return;
    self.handle_segment(segment);
    self.set_segment(segment);
  }

  static GstFlowReturn sink_event_pre_queue(GstAggregator* element, GstAggregatorPad* pad,
                                            GstEvent* event) {
    if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT_DONE) event = gap_at_segment_end(pad, event);
    return PARENT_AGGREGATOR_CLASS->sink_event_pre_queue(element, pad, event);
  }

  static gboolean sink_event(GstAggregator* element, GstAggregatorPad* pad, GstEvent* event) {
    auto& self = of(element);
    if (GST_EVENT_TYPE(event) == GST_EVENT_CAPS) {
      const bool handled = guard(self, [&] { return handle_caps(self, pad, event); });
      gst_event_unref(event);
      return handled ? TRUE : FALSE;
    }
    if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT) {
      if (!plays_events(element, event, self.role_.verb)) return FALSE;
      if (!guard(self, [&] { handle_segment(self, pad, segment_of(event)); })) {
        gst_event_unref(event);
        return FALSE;
      }
    }
    if (is_passed_on(self, pad, event)) {
      OwnedEvent passed(event);
      if (self.main_pad_ != nullptr && pad != self.main_pad_) return TRUE;
      return guard(self, [&] { return pass_on(self, std::move(passed)); });
    }
    if (GST_EVENT_TYPE(event) == GST_EVENT_GAP) store_segment_end(pad, event);
    if (GST_EVENT_TYPE(event) == GST_EVENT_FLUSH_STOP) forget_segment_end(pad);
    return PARENT_AGGREGATOR_CLASS->sink_event(element, pad, event);
  }

  static gboolean seek(EventAggregator& self, OwnedEvent event) {
    GstAggregator* const element = self.element_;
    if (!count_from_start(event, self.main_pad_ != nullptr ? GST_PAD(self.main_pad_)
                                                           : GST_AGGREGATOR_SRC_PAD(element)))
      return FALSE;
    const SeekRequest request(event.get());
    if (self.main_pad_ == nullptr && !request.flushes()) {
      GST_WARNING_OBJECT(element, "does not flush: refused %" GST_PTR_FORMAT, event.get());
      return FALSE;
    }
    // gst_aggregator_do_seek() stops the source pad's task before it forwards a flushing seek, and
    // does not start it again if that fails.
    bool all_would = true;
    for_each_sink_pad(element, [&](GstAggregatorPad* pad) {
      if (would_seek(GST_PAD(pad), request)) return;
      GST_WARNING_OBJECT(pad, "upstream would refuse: refused %" GST_PTR_FORMAT, event.get());
      all_would = false;
    });
    if (!all_would) return FALSE;
    GST_DEBUG_OBJECT(element, "forwarding %" GST_PTR_FORMAT, event.get());
    // gst_aggregator_do_seek() would apply it to the output's segment at once, before the new
    // segment of the main pad arrives.
    if (!request.flushes()) return forward(element, event.release());
    self.prepare_seek(request);
    return PARENT_AGGREGATOR_CLASS->src_event(element, event.release());
  }

  static gboolean src_event(GstAggregator* element, GstEvent* event) {
    auto& self = of(element);
    if (GST_EVENT_TYPE(event) == GST_EVENT_SEEK) return seek(self, OwnedEvent(event));
    if (GST_EVENT_TYPE(event) == GST_EVENT_RECONFIGURE && self.role_.passes_main_pad)
      gst_pad_push_event(GST_PAD(self.main_pad_), gst_event_ref(event));  // it decides on the caps
    return PARENT_AGGREGATOR_CLASS->src_event(element, event);
  }

  /// Answers with the range of the main pad, or of the first one.
  /// gst_aggregator_default_src_query() answers "not seekable".
  static gboolean answer_seeking(const EventAggregator& self, GstQuery* query) {
    bool is_first = true;
    bool all_can = true;
    gboolean is_answered = FALSE;
    for_each_sink_pad(self.element_, [&](GstAggregatorPad* pad) {
      if (pad == self.main_pad_ || (self.main_pad_ == nullptr && std::exchange(is_first, false)))
        is_answered = gst_pad_peer_query(GST_PAD(pad), query);
      all_can = all_can && peer_can_seek(GST_PAD(pad), GST_FORMAT_TIME);
    });
    if (!is_answered) return FALSE;
    GstFormat format = GST_FORMAT_UNDEFINED;
    gint64 start = -1;
    gint64 end = -1;
    gst_query_parse_seeking(query, &format, nullptr, &start, &end);
    all_can = all_can && format == GST_FORMAT_TIME;
    gst_query_set_seeking(query, format, all_can ? TRUE : FALSE, start, end);
    return TRUE;
  }

  static gboolean src_query(GstAggregator* element, GstQuery* query) {
    return GST_QUERY_TYPE(query) == GST_QUERY_SEEKING
               ? answer_seeking(of(element), query)
               : PARENT_AGGREGATOR_CLASS->src_query(element, query);
  }

  /// Answers ALLOCATION queries at once. gst_aggregator_default_sink_query_pre_queue() queues them
  /// behind buffers, which may wait for another pad while the upstream of both, such as a tee,
  /// waits for the answer.
  static gboolean sink_query_pre_queue(GstAggregator* element, GstAggregatorPad* pad,
                                       GstQuery* query) {
    if (GST_QUERY_TYPE(query) == GST_QUERY_ALLOCATION)
      return is_passed(of(element), pad)
                 ? gst_pad_peer_query(GST_AGGREGATOR_SRC_PAD(element), query)
                 : FALSE;
    return PARENT_AGGREGATOR_CLASS->sink_query_pre_queue(element, pad, query);
  }

  static gboolean sink_query(GstAggregator* element, GstAggregatorPad* pad, GstQuery* query) {
    if (!is_passed(of(element), pad) || GST_QUERY_TYPE(query) != GST_QUERY_CAPS)
      return PARENT_AGGREGATOR_CLASS->sink_query(element, pad, query);
    answer_caps_of_passed(of(element), element, pad, query);
    return TRUE;
  }

  static GstFlowReturn flush(GstAggregator* element) {
    auto& self = of(element);
    GST_DEBUG_OBJECT(element, "flushed: dropping events that wait");
    forget_segment_ends(self);
    self.segment_sent_ = false;
    std::erase_if(self.waiting_, [](const OwnedEvent& event) {
      return (gst_event_type_get_flags(GST_EVENT_TYPE(event.get())) & GST_EVENT_TYPE_STICKY) == 0;
    });
    return guard(self, [&] {
      self.flush();
      return GST_FLOW_OK;
    });
  }

  static gboolean start(GstAggregator* element) {
    auto& self = of(element);
    return guard(self, [&] { return self.start(); }) ? TRUE : FALSE;
  }

  static gboolean stop(GstAggregator* element) {
    auto& self = of(element);
    guard(self, [&] { self.stop(); });
    forget_segment_ends(self);
    self.segment_sent_ = false;
    self.main_caps_.reset();
    self.waiting_.clear();
    self.faults_.reset();
    return TRUE;
  }
};

std::unique_ptr<EventAggregator>& gst_event_aggregator_impl(gpointer element) {
  return *static_cast<GstEventAggregatorPrivate*>(
      gst_event_aggregator_get_instance_private(GST_EVENT_AGGREGATOR(element)));
}

void gst_event_aggregator_add_pads(GstEventAggregator* self) {
  for (const GList* templates =
           gst_element_class_get_pad_template_list(GST_ELEMENT_GET_CLASS(self));
       templates != nullptr; templates = templates->next) {
    auto* pad_template = GST_PAD_TEMPLATE(templates->data);
    if (GST_PAD_TEMPLATE_DIRECTION(pad_template) == GST_PAD_SINK &&
        GST_PAD_TEMPLATE_PRESENCE(pad_template) == GST_PAD_ALWAYS)
      gst_element_add_pad(
          GST_ELEMENT(self),
          GST_PAD(g_object_new(GST_TYPE_AGGREGATOR_PAD, "name",
                               GST_PAD_TEMPLATE_NAME_TEMPLATE(pad_template), "direction",
                               GST_PAD_SINK, "template", pad_template, nullptr)));
  }
}

static void finalize(GObject* object) {
  std::destroy_at(&gst_event_aggregator_impl(object));
  G_OBJECT_CLASS(gst_event_aggregator_parent_class)->finalize(object);
}

static void gst_event_aggregator_init(GstEventAggregator* self) {
  std::construct_at(&gst_event_aggregator_impl(self));
  GstPad* const src = GST_AGGREGATOR_SRC_PAD(self);
  gst_pad_add_probe(
      src,
      static_cast<GstPadProbeType>(GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM),
      EventAggregatorFunctions::probe_output, self, nullptr);
}

static void gst_event_aggregator_class_init(GstEventAggregatorClass* klass) {
  G_OBJECT_CLASS(klass)->finalize = finalize;

  using Functions = EventAggregatorFunctions;
  GstAggregatorClass* aggregator_class = GST_AGGREGATOR_CLASS(klass);
  aggregator_class->aggregate = Functions::aggregate;
  aggregator_class->get_next_time = Functions::get_next_time;
  aggregator_class->update_src_caps = Functions::update_src_caps;
  aggregator_class->sink_event_pre_queue = Functions::sink_event_pre_queue;
  aggregator_class->sink_event = Functions::sink_event;
  aggregator_class->src_event = Functions::src_event;
  aggregator_class->src_query = Functions::src_query;
  aggregator_class->sink_query_pre_queue = Functions::sink_query_pre_queue;
  aggregator_class->sink_query = Functions::sink_query;
  aggregator_class->flush = Functions::flush;
  aggregator_class->start = Functions::start;
  aggregator_class->stop = Functions::stop;
}
